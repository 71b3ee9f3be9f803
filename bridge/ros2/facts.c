// SPDX-License-Identifier: MIT
#include "facts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TICKS_PER_TURN 60.0

bool ros_facts_read(const iwc_t *gateway, const iwc_message_t *message, ros_machine_t *out_machine) {
    if (!iwc_state(gateway, message, &out_machine->now)) {
        return false;
    }
    out_machine->wall_us = iwc_integer(message, "wall_us").value;
    out_machine->lease_ms = iwc_integer(message, "lease.lease_ms").value;
    (void)iwc_text(message, "estop.state", out_machine->estop, sizeof out_machine->estop);
    (void)iwc_text(message, "bus.state", out_machine->bus, sizeof out_machine->bus);
    (void)iwc_text(message, "bus.timing", out_machine->timing, sizeof out_machine->timing);
    (void)iwc_text(message, "lease.name", out_machine->holder, sizeof out_machine->holder);
    return true;
}

/// A number at the beginning of a ledger entry's value; `otherwise` if there is none above 0.
static long value_of(const iwc_message_t *ledger, const char *item, long otherwise) {
    char path[48];
    char text[48];
    (void)snprintf(path, sizeof path, "%s.value", item);
    const long value = iwc_text(ledger, path, text, sizeof text) ? strtol(text, NULL, 10) : 0;
    return (value > 0) ? value : otherwise;
}

static bool is_confirmed(const iwc_message_t *ledger, const char *item) {
    char path[48];
    (void)snprintf(path, sizeof path, "%s.state", item);
    return iwc_is(ledger, path, "confirmed");
}

static void tell_contradiction(const iwc_message_t *ledger, const char *item, ros_machine_t *machine) {
    char path[48];
    char reason[160];
    char cure[160];
    (void)snprintf(path, sizeof path, "%s.reason", item);
    (void)iwc_text(ledger, path, reason, sizeof reason);
    (void)snprintf(path, sizeof path, "%s.disabled", item);
    (void)iwc_text(ledger, path, cure, sizeof cure);
    const size_t used = strlen(machine->contradicted);
    (void)snprintf(machine->contradicted + used, sizeof machine->contradicted - used, "%s%s: %s; %s",
                   (used > 0) ? ". " : "", item, reason, cure);
}

void ros_facts_read_ledger(const iwc_message_t *message, ros_machine_t *machine) {
    static const char *const items[] = {"setpoint_type",
                                        "current_role",
                                        "force_unit_left",
                                        "force_unit_right",
                                        "offset_included",
                                        "feedback_sign_left",
                                        "feedback_sign_right",
                                        "mount_sign_left",
                                        "mount_sign_right",
                                        "wheel_radius",
                                        "track",
                                        "gear_ratio",
                                        "pose_byte_order",
                                        "dlc"};
    char path[48];
    char gear[32];
    char *slash;
    iwc_message_t ledger = {.is_event = true};
    ledger.text = iwc_json(message, "ledger", &ledger.length);
    if (ledger.text == NULL) {
        return;
    }
    machine->contradicted[0] = '\0';
    machine->assumed = 0;
    for (size_t i = 0; i < sizeof items / sizeof items[0]; i++) {
        (void)snprintf(path, sizeof path, "%s.state", items[i]);
        machine->assumed += iwc_is(&ledger, path, "assumed") ? 1U : 0U;
        if (iwc_is(&ledger, path, "contradicted")) {
            tell_contradiction(&ledger, items[i], machine);
        }
    }
    machine->setpoint_current = iwc_is(&ledger, "current_role.value", "setpoint");
    machine->radius_mm = value_of(&ledger, "wheel_radius", 192);
    machine->track_mm = value_of(&ledger, "track", 540);
    (void)iwc_text(&ledger, "gear_ratio.value", gear, sizeof gear);
    const double turns = strtod(gear, &slash);
    const double per = (*slash == '/') ? strtod(slash + 1, NULL) : 1.0;
    const double rotor_turns = (turns > 0.0 && per > 0.0) ? turns / per : 1.0;
    machine->measures = (ros_measures_t){
        .radius_confirmed = is_confirmed(&ledger, "wheel_radius"),
        .track_confirmed = is_confirmed(&ledger, "track"),
        .tick_m = 2.0 * M_PI * (double)machine->radius_mm / 1000.0 / TICKS_PER_TURN / rotor_turns,
        .track_m = (double)machine->track_mm / 1000.0,
    };
}
