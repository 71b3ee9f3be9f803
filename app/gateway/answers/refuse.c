// SPDX-License-Identifier: MIT
#include "dispatch.h"

#include "ledger/knowledge.h"
#include "sockets/clients.h"
#include "status/observe.h"
#include "wheels/wheels.h"

#include "iwheel_northbound/refuse.h"

#include <stdio.h>
#include <string.h>

#define GW_STOPPER_SIZE 48U

/// The texts that only this machine knows, for one message.
typedef struct {
    char holder[GW_CLIENT_TEXT_SIZE];
    char stale_client[GW_CLIENT_TEXT_SIZE];
    char stopped_by[GW_STOPPER_SIZE];
    char estopped_by[GW_STOPPER_SIZE];
    char bus_cure[256];
    char stalled_cure[320];
    char timing[320];
    char contradiction[IWN_SENTENCE_SIZE];
} texts_t;

static void name_client(const gw_answers_t *answers, iw_client_t id, char *out_text, size_t size) {
    const gw_client_t *client = gw_clients_find(answers->clients, id);
    if (client != NULL) {
        gw_client_describe(client, out_text, size);
    } else {
        (void)snprintf(out_text, size, "client %u (gone)", (unsigned)id);
    }
}

/// NULL if nobody asked for it yet.
static const char *name_stopper(const gw_stopper_t *by, char out_text[GW_STOPPER_SIZE]) {
    (void)snprintf(out_text, GW_STOPPER_SIZE, "user %u (process %d)", (unsigned)by->uid, by->pid);
    return (by->at_us > 0U) ? out_text : NULL;
}

static void describe_bus(const gw_wheels_t *wheels, const iw_snapshot_t *seen, texts_t *texts) {
    const char *bus = wheels->bus.name;
    const bool local = iw_linux_hal_link(&wheels->hal)->presence == IW_LINK_LOCAL;
    const bool off = seen->bus == IW_BUS_OFF;
    (void)snprintf(texts->bus_cure, sizeof texts->bus_cure, "%s%s",
                   (local && off) ? "end it in the simulator: iwheel-sim busoff off"
                   : local        ? "start the simulator: iwheel-sim --can "
                   : off          ? "check cable, termination and bit rate; what else: iwheelctl doctor "
                                  : "bring it up; how: iwheelctl doctor ",
                   (local && off) ? "" : bus);
    if (!local) {
        (void)snprintf(texts->stalled_cure, sizeof texts->stalled_cure,
                       "; if so, it was lost: ip link set %s down; ip link set %s up", bus, bus);
    }
    (void)snprintf(texts->timing, sizeof texts->timing,
                   "the bit timing of %s is not %u bit/s with sample point %u permille; set it, or on_mismatch = warn",
                   bus, (unsigned)wheels->bus.bitrate_hz, wheels->bus.sample_point_permille);
}

void gw_refuse_describe(const gw_answers_t *answers, const iwn_request_t *request, iw_refusal_t refusal,
                        iwn_refusal_t *out_refusal) {
    const gw_wheels_t *wheels = answers->wheels;
    const gw_status_t *status = answers->status;
    const iw_snapshot_t seen = gw_wheels_look(wheels);
    texts_t texts = {.contradiction = ""};
    name_client(answers, seen.holder, texts.holder, sizeof texts.holder);
    name_client(answers, seen.stale_client, texts.stale_client, sizeof texts.stale_client);
    describe_bus(wheels, &seen, &texts);
    if (refusal == IW_REFUSE_CONTRADICTED) {
        gw_knowledge_describe_contradiction(answers->knowledge, seen.doubt, texts.contradiction,
                                            sizeof texts.contradiction);
    }
    const iwn_refuse_context_t context = {
        .seen = &seen,
        .holder = texts.holder,
        .stale_client = texts.stale_client,
        .last_stop = status->last_stop.sentence,
        .stopped_by = name_stopper(&status->stopped_by, texts.stopped_by),
        .estopped_by = name_stopper(&status->estopped_by, texts.estopped_by),
        .estopped_us = status->estopped_by.at_us,
        .estop = gw_wheels_estop(wheels),
        .estop_answer = wheels->hal.estop_last,
        .bus = wheels->bus.name,
        .bus_cure = texts.bus_cure,
        .stalled_cure = texts.stalled_cure,
        .timing = texts.timing,
        .contradiction = texts.contradiction,
        .configure = "under [wheels] in the configuration",
        .listen_only = "the gateway runs with --listen-only and never sends; start it without",
        .shutting_down = wheels->shutting_down,
    };
    iwn_refuse_describe(&context, request, refusal, out_refusal);
}

static void say_right(const gw_answers_t *answers, iwn_refusal_t *out_refusal) {
    const char *socket = answers->socket;
    const char *group = answers->group;
    out_refusal->error = IWN_DENIED;
    if (strcmp(group, "none") == 0) {
        (void)snprintf(out_refusal->message, sizeof out_refusal->message,
                       "this socket is for watching, stop and estop; who may drive uses %s", socket);
    } else {
        (void)snprintf(out_refusal->message, sizeof out_refusal->message,
                       "this socket is for watching, stop and estop; who may drive uses %s and is in group %s (sudo "
                       "usermod -aG %s USER, then log in again)",
                       socket, group, group);
    }
}

bool gw_refuse_by_right(const gw_answers_t *answers, gw_right_t right, iwn_cmd_t cmd, iwn_refusal_t *out_refusal) {
    if (right == GW_DRIVE || iwn_cmd_watches(cmd)) { // Who has come to stop may stop: dispatch.c sees to the rest.
        return false;
    }
    say_right(answers, out_refusal);
    return true;
}
