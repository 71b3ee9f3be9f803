// SPDX-License-Identifier: MIT
#include "observe.h"

#include "bus/bus_facts.h"
#include "inspect.h"
#include "ledger/knowledge.h"
#include "sockets/clients.h"
#include "wheels/wheels.h"

#include "iwheel_linux/clock.h"

static iwn_holder_t holder_of(gw_clients_t *clients, iw_client_t id) {
    const gw_client_t *client = gw_clients_find(clients, id);
    return (client != NULL) ? (iwn_holder_t){.client = id, .name = client->name, .pid = client->pid}
                            : (iwn_holder_t){.client = IW_CLIENT_NONE};
}

static iwn_bus_t bus_of(const gw_wheels_t *wheels) {
    const iw_bus_link_t *link = iw_linux_hal_link(&wheels->hal);
    return (iwn_bus_t){.name = wheels->bus.name,
                       .timing = gw_bus_facts_timing(&wheels->bus, link),
                       .bitrate_hz = link->bitrate_hz,
                       .sample_point_permille = link->sample_point_permille,
                       .load_permille = link->load_permille,
                       .lost = link->lost,
                       .up = link->presence == IW_LINK_UP};
}

static iwn_estop_t estop_of(const gw_wheels_t *wheels) {
    const iw_estop_ops_t *kind = wheels->hal.estop_ops;
    return (iwn_estop_t){.line = wheels->estop,
                         .line2 = wheels->hal.two_contacts ? wheels->estop2 : NULL,
                         .pressed_at = inspect_pressed_at(&wheels->hal),
                         .answer = wheels->hal.estop_last,
                         .present = kind->present,
                         .simulated = kind->simulated,
                         .tried_us = wheels->estop_tried_us};
}

static iwn_zero_note_t zero_of(const gw_known_offset_t *known) {
    return (iwn_zero_note_t){.from = known->from,
                             .samples = known->samples,
                             .deviation_mN = known->deviation_mN,
                             .drift_mN = known->drift_mN,
                             .wall_us = known->wall_us};
}

iwn_surroundings_t gw_snapshot_around(const gw_status_t *status, const iw_snapshot_t *seen) {
    const gw_wheels_t *wheels = status->wheels;
    const gw_known_offset_t *known = status->knowledge->known.offset;
    iwn_surroundings_t around = {.wall_us = iw_clock_wall_us(),
                                 .version = IWHEEL_VERSION,
                                 .holder = holder_of(status->clients, seen->holder),
                                 .bus = bus_of(wheels),
                                 .estop = estop_of(wheels),
                                 .zero = {zero_of(&known[IW_LEFT]), zero_of(&known[IW_RIGHT])},
                                 .warnings = wheels->warnings,
                                 .clients = gw_clients_count(status->clients),
                                 .shutting_down = wheels->shutting_down};
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

void gw_snapshot_write(const gw_status_t *status, iwn_out_t *json) {
    const iw_snapshot_t seen = gw_wheels_look(status->wheels);
    const iwn_surroundings_t around = gw_snapshot_around(status, &seen);
    iwn_tell_machine(&seen, &around, json);
    gw_knowledge_write(status->knowledge, &seen, json);
    iwn_out_open(json, "gaps", '{');
    gw_gaps_write(&status->wheels->gaps, json);
    iwn_out_close(json, '}');
    iwn_tell_rest(&seen, &around, json);
}

void gw_snapshot_write_force(const gw_status_t *status, iwn_out_t *json) {
    const iw_snapshot_t seen = gw_wheels_look(status->wheels);
    const iwn_surroundings_t around = gw_snapshot_around(status, &seen);
    iwn_tell_force(&seen, &around, json);
}
