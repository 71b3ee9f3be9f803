// SPDX-License-Identifier: MIT
// Refusals: the parts that only this daemon knows.
#include "answers.h"

#include "assumptions/assumptions.h"
#include "wheels/wheels.h"

#include "iwheel_server/target.h"

#include <stdio.h>
#include <string.h>

void gw_answers_describe(gw_answers_t *self, iw_client_t id, char out_text[GW_CLIENT_TEXT_SIZE]) {
    const iwn_client_t *client = iwn_server_find(&self->server, id);
    const int pid = (client != NULL) ? gw_answers_connection(self, client)->pid : 0;
    if (client == NULL) {
        (void)snprintf(out_text, GW_CLIENT_TEXT_SIZE, "client %u (gone)", (unsigned)id);
    } else if (client->name[0] != '\0') {
        (void)snprintf(out_text, GW_CLIENT_TEXT_SIZE, "\"%s\" (client %u, pid %d)", client->name, (unsigned)id, pid);
    } else {
        (void)snprintf(out_text, GW_CLIENT_TEXT_SIZE, "client %u (pid %d)", (unsigned)id, pid);
    }
}

const char *iwn_target_name(iwn_server_t *server, iw_client_t id) {
    gw_answers_t *self = gw_answers_of(server);
    gw_answers_describe(self, id, self->text);
    return self->text;
}

/// Returns NULL if no client has requested it.
static const char *name_stopper(const gw_stopper_t *by, iw_time_us_t at_us, char out_text[GW_STOPPER_SIZE]) {
    (void)snprintf(out_text, GW_STOPPER_SIZE, "user %u (process %d)", (unsigned)by->uid, by->pid);
    return (at_us > 0U) ? out_text : NULL;
}

static void describe_bus(const gw_wheels_t *wheels, const iw_snapshot_t *seen, gw_refuse_texts_t *texts) {
    const char *bus = wheels->bus.name;
    const bool local = iwl_hal_link(&wheels->hal)->presence == IWL_LINK_LOCAL;
    const bool off = seen->bus == IW_BUS_OFF;
    (void)snprintf(texts->bus_fix, sizeof texts->bus_fix, "%s%s",
                   (local && off) ? "end it in the simulator: iwheel-sim busoff off"
                   : local        ? "start the simulator: iwheel-sim --can "
                   : off          ? "check cable, termination and bit rate; for more checks: iwheelctl doctor "
                                  : "bring it up; how: iwheelctl doctor ",
                   (local && off) ? "" : bus);
    texts->stalled_fix[0] = '\0';
    if (!local) {
        (void)snprintf(texts->stalled_fix, sizeof texts->stalled_fix,
                       "; if so, it was lost: ip link set %s down; ip link set %s up", bus, bus);
    }
    (void)snprintf(texts->timing, sizeof texts->timing,
                   "the bit timing of %s is not %u bit/s with sample point %u permille; set it, or on_mismatch = warn",
                   bus, (unsigned)wheels->bus.bitrate_hz, wheels->bus.sample_point_permille);
}

void iwn_target_describe(iwn_server_t *server, iw_refusal_t refusal, iwn_refuse_context_t *context) {
    gw_answers_t *self = gw_answers_of(server);
    const gw_wheels_t *wheels = self->wheels;
    gw_refuse_texts_t *texts = &self->texts;
    gw_answers_describe(self, context->seen->holder, texts->holder);
    gw_answers_describe(self, context->seen->stale_client, texts->stale_client);
    describe_bus(wheels, context->seen, texts);
    texts->contradiction[0] = '\0';
    if (refusal == IW_REFUSE_CONTRADICTED) {
        iwn_target_contradiction(server, context->seen->doubt, texts->contradiction, sizeof texts->contradiction);
    }
    context->holder = texts->holder;
    context->stale_client = texts->stale_client;
    context->stopped_by = name_stopper(&self->stopped_by, server->stopped_us, texts->stopped_by);
    context->estopped_by = name_stopper(&self->estopped_by, server->estopped_us, texts->estopped_by);
    context->estop = gw_wheels_estop(wheels);
    context->bus_fix = texts->bus_fix;
    context->stalled_fix = texts->stalled_fix;
    context->timing = texts->timing;
    context->contradiction = texts->contradiction;
    context->configure = (refusal == IW_REFUSE_TRACK_NOT_SET)
                             ? "under [wheels] in the configuration (iwheelctl bringup measures it)"
                             : "under [wheels] in the configuration";
    context->listen_only = "the gateway runs with --listen-only and never sends; start it without";
    context->shutting_down = wheels->shutting_down;
}

void iwn_target_contradiction(iwn_server_t *server, iw_assumption_item_t item, char *out_text, size_t size) {
    gw_assumptions_describe_contradiction(gw_answers_of(server)->assumptions, item, out_text, size);
}

void iwn_target_refuse_right(iwn_server_t *server) {
    const gw_answers_t *self = gw_answers_of(server);
    char *message = server->refusal.message;
    const size_t size = sizeof server->refusal.message;
    if (strcmp(self->group, "none") == 0) {
        (void)snprintf(message, size, "this socket is for watching, stop and estop; clients that drive use %s",
                       self->socket);
    } else {
        (void)snprintf(
            message, size,
            "this socket is for watching, stop and estop; clients that drive use %s and are in group %s (sudo "
            "usermod -aG %s USER, then log in again)",
            self->socket, self->group, self->group);
    }
}
