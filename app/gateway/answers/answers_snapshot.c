// SPDX-License-Identifier: MIT
// Status: the parts outside the core.
#include "answers.h"

#include "assumptions/assumptions.h"
#include "box/box.h"
#include "bus/bus_facts.h"
#include "wheels/wheels.h"

#include "iwheel_linux/clock.h"
#include "iwheel_server/target.h"

static iwn_holder_t holder_of(gw_answers_t *self, iw_client_t id) {
    const iwn_client_t *client = iwn_server_find(&self->server, id);
    return (client != NULL)
               ? (iwn_holder_t){.client = id, .name = client->name, .pid = gw_answers_connection(self, client)->pid}
               : (iwn_holder_t){.client = IW_CLIENT_NONE};
}

static iwn_bus_t bus_of(const gw_wheels_t *wheels) {
    const iwl_bus_link_t *link = iwl_hal_link(&wheels->hal);
    return (iwn_bus_t){.name = wheels->bus.name,
                       .timing = gw_bus_facts_timing(&wheels->bus, link),
                       .bitrate_hz = link->bitrate_hz,
                       .sample_point_permille = link->sample_point_permille,
                       .load_permille = link->load_permille,
                       .lost = link->lost,
                       .up = link->presence == IWL_LINK_UP};
}

static iwn_zero_note_t zero_of(const gw_stored_offset_t *known) {
    return (iwn_zero_note_t){.from = known->from,
                             .samples = known->samples,
                             .deviation_mN = known->deviation_mN,
                             .drift_mN = known->drift_mN,
                             .wall_us = known->wall_us};
}

iwn_surroundings_t iwn_target_around(iwn_server_t *server, const iw_snapshot_t *seen) {
    gw_answers_t *self = gw_answers_of(server);
    const gw_wheels_t *wheels = self->wheels;
    const gw_stored_offset_t *known = self->assumptions->known.offset;
    iwn_surroundings_t around = {.wall_us = iwl_clock_wall_us(),
                                 .version = server->version,
                                 .holder = holder_of(self, seen->holder),
                                 .bus = bus_of(wheels),
                                 .estop = server->estop,
                                 .zero = {zero_of(&known[IW_LEFT]), zero_of(&known[IW_RIGHT])},
                                 .warnings = wheels->warnings,
                                 .clients = sock_clients_count(self->clients),
                                 .shutting_down = wheels->shutting_down};
    around.estop.tried_us = wheels->estop_tried_us;
    for (uint32_t i = 0; i < wheels->warnings; i++) {
        around.warning[i] = wheels->warning[i];
    }
    if (seen->holding && around.warnings < IWN_WARNINGS) {
        around.warning[around.warnings++] = "zeros hold the wheels until release (iwheelctl release) or arm; without "
                                            "them the machine may roll: use its parking brake";
    }
    if (seen->rolling && around.warnings < IWN_WARNINGS) {
        around.warning[around.warnings++] =
            "a wheel turns although nothing is sent to it; hold the machine, or use its parking brake";
    }
    return around;
}

void iwn_target_write_assumptions(iwn_server_t *server, const iw_snapshot_t *seen, iwn_out_t *json) {
    gw_answers_t *self = gw_answers_of(server);
    gw_assumptions_write(self->assumptions, seen, json);
    iwn_out_open(json, "gaps", '{');
    gw_gaps_write(&self->wheels->gaps, json);
    iwn_out_close(json, '}');
}

void iwn_target_status(iwn_server_t *server, iwn_client_t *client) {
    iwn_out_t json = iwn_server_begin_reply(server, &server->request.id);
    iwn_server_write_status(server, iwn_server_snapshot(server), &json);
    iwn_server_send_reply(server, client, &json);
}

/// Written once for all clients that receive it.
void iwn_target_state(iwn_server_t *server, const iw_snapshot_t *seen, bool due_only) {
    size_t length = 0;
    for (iwn_client_t *client = iwn_target_next(server, NULL); client != NULL;
         client = iwn_target_next(server, client)) {
        if ((client->topics & (1U << IWN_TOPIC_STATE)) == 0U || (due_only && !client->due)) {
            continue;
        }
        if (length == 0U) {
            iwn_out_t json = iwn_server_begin_event(server, "state");
            iwn_server_write_status(server, seen, &json);
            iwn_out_close(&json, '}');
            length = iwn_out_finish(&json);
        }
        iwn_target_event(server, client, gw_answers_of(server)->clients->line, length);
    }
}

void iwn_target_write_why(iwn_server_t *server, iwn_out_t *json) {
    const gw_answers_t *self = gw_answers_of(server);
    gw_record_write(self->box, server->last_stop.stop.number, json);
    gw_wheels_write_around(self->wheels, json);
}
