// SPDX-License-Identifier: MIT
#include "facts.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TICKS_PER_TURN 60.0

bool ros_facts_read(const iwc_t *gateway, const iwc_message_t *message, ros_machine_t *out_machine) {
    if (!iwc_state(gateway, message, &out_machine->now)) {
        return false;
    }
    iwc_cursor_t cursor = {message, NULL}; // In the order of the gateway.
    const iwc_message_t wall_us = iwc_field(&cursor, "wall_us");
    const iwc_message_t lease = iwc_field(&cursor, "lease");
    const iwc_message_t bus = iwc_field(&cursor, "bus");
    const iwc_message_t estop = iwc_field(&cursor, "estop");
    const iwc_message_t holding = iwc_field(&cursor, "holding");
    const iwc_message_t rolling = iwc_field(&cursor, "rolling");
    out_machine->wall_us = iwc_integer(&wall_us, "").value;
    (void)iwc_text(&lease, "name", out_machine->holder, sizeof out_machine->holder);
    out_machine->lease_ms = iwc_integer(&lease, "lease_ms").value;
    (void)iwc_text(&bus, "state", out_machine->bus, sizeof out_machine->bus);
    (void)iwc_text(&bus, "timing", out_machine->timing, sizeof out_machine->timing);
    (void)iwc_text(&estop, "state", out_machine->estop, sizeof out_machine->estop);
    (void)iwc_text(&estop, "pressed_at", out_machine->pressed_at, sizeof out_machine->pressed_at);
    out_machine->estop_simulated = iwc_truth(&estop, "simulated").value != 0;
    out_machine->estop_tried = iwc_integer(&estop, "tried_wall_us").known;
    out_machine->holding = iwc_truth(&holding, "").value != 0;
    out_machine->rolling = iwc_truth(&rolling, "").value != 0;
    return true;
}

ros_estop_t ros_facts_estop(const ros_facts_t *facts) {
    const char *state = facts->machine.estop;
    if (state[0] == '\0' || strcmp(state, "none") == 0) {
        return ROS_ESTOP_NO_LINE;
    }
    return (facts->link == ROS_LINK_UP && strcmp(state, "released") == 0) ? ROS_ESTOP_RELEASED : ROS_ESTOP_PRESSED;
}

void ros_facts_type_name(const char *dds, char *out, size_t size) {
    size_t used = 0;
    for (; *dds != '\0' && used + 1U < size; dds++) {
        if (strncmp(dds, "::dds_", 6) == 0) {
            dds += 5;
        } else if (strncmp(dds, "::", 2) == 0) {
            out[used++] = '/';
            dds++;
        } else {
            const bool is_allowed = isalnum((unsigned char)*dds) || *dds == '_' || *dds == '/';
            out[used++] = '?';
            if (is_allowed) {
                out[used - 1U] = *dds;
            }
        }
    }
    if (used > 0U && *dds == '\0' && out[used - 1U] == '_') {
        used--;
    }
    out[used] = '\0';
}

/// Assumptions with a value that the bridge uses, and the configuration keys of these values.
typedef enum { RADIUS, TRACK, GEAR, ROLE } valued_t;
static const struct {
    const char *item;
    const char *key;
} valued[ROS_CONFIGURED] = {[RADIUS] = {"wheel_radius", "wheels.radius_mm"},
                            [TRACK] = {"track", "wheels.track_mm"},
                            [GEAR] = {"gear_ratio", "wheels.gear_ratio"},
                            [ROLE] = {"current_role", "wheels.current_role"}};

bool ros_facts_lack_values(const iwc_message_t *snapshot) {
    char value[48];
    return !iwc_text(snapshot, "ledger.track.value", value, sizeof value);
}

void ros_facts_read_config(const iwc_message_t *reply, ros_machine_t *machine) {
    size_t left = 0;
    machine->assumptions_length = 0;
    const char *at = iwc_json(reply, "keys", &left);
    const char *end = (at != NULL) ? at + left : NULL;
    // The list has objects of two strings. No string has a brace in it.
    while (at != NULL && (at = memchr(at, '{', (size_t)(end - at))) != NULL) {
        const char *close = memchr(at, '}', (size_t)(end - at));
        if (close == NULL) {
            return;
        }
        const iwc_message_t entry = {.text = at, .length = (size_t)(close - at) + 1U};
        for (size_t i = 0; i < ROS_CONFIGURED; i++) {
            if (iwc_is(&entry, "key", valued[i].key)) {
                (void)iwc_text(&entry, "value", machine->configured[i], sizeof machine->configured[i]);
            }
        }
        at = close;
    }
}

/// Writes the value of an assumption to `out`, or the configured value; empty: neither is known.
static void text_of(const iwc_message_t *assumptions, valued_t which, const ros_machine_t *machine, char out[48]) {
    char path[48];
    (void)snprintf(path, sizeof path, "%s.value", valued[which].item);
    if (!iwc_text(assumptions, path, out, 48)) {
        (void)snprintf(out, 48, "%s", machine->configured[which]);
    }
}

/// Returns the number at the beginning of the value; `otherwise` if there is none above 0.
static long value_of(const iwc_message_t *assumptions, valued_t which, const ros_machine_t *machine, long otherwise) {
    char text[48];
    text_of(assumptions, which, machine, text);
    const long value = strtol(text, NULL, 10);
    return (value > 0) ? value : otherwise;
}

static bool is_confirmed(const iwc_message_t *assumptions, const char *item) {
    char path[48];
    (void)snprintf(path, sizeof path, "%s.state", item);
    return iwc_is(assumptions, path, "confirmed");
}

static void report_contradiction(const iwc_message_t *assumptions, const char *item, ros_machine_t *machine) {
    char path[48];
    char reason[160];
    char fix[160];
    (void)snprintf(path, sizeof path, "%s.reason", item);
    (void)iwc_text(assumptions, path, reason, sizeof reason);
    (void)snprintf(path, sizeof path, "%s.disabled", item);
    (void)iwc_text(assumptions, path, fix, sizeof fix);
    const size_t used = strlen(machine->contradicted);
    (void)snprintf(machine->contradicted + used, sizeof machine->contradicted - used, "%s%s: %s; %s",
                   (used > 0) ? ". " : "", item, reason, fix);
}

/// Returns true if the assumptions are those of the last call; otherwise stores them for the next call.
static bool are_assumptions_unchanged(ros_machine_t *machine, const iwc_message_t *assumptions) {
    const size_t length = assumptions->length;
    if (length == machine->assumptions_length && memcmp(assumptions->text, machine->assumptions, length) == 0) {
        return true;
    }
    machine->assumptions_length = (length <= sizeof machine->assumptions) ? length : 0U;
    memcpy(machine->assumptions, assumptions->text, machine->assumptions_length);
    return false;
}

void ros_facts_read_assumptions(const iwc_message_t *message, ros_machine_t *machine) {
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
    char text[48];
    char *slash;
    iwc_message_t assumptions = {.is_event = true};
    assumptions.text = iwc_json(message, "ledger", &assumptions.length);
    if (assumptions.text == NULL || are_assumptions_unchanged(machine, &assumptions)) {
        return;
    }
    machine->contradicted[0] = '\0';
    machine->assumed = 0;
    for (size_t i = 0; i < sizeof items / sizeof items[0]; i++) {
        (void)snprintf(path, sizeof path, "%s.state", items[i]);
        machine->assumed += iwc_is(&assumptions, path, "assumed") ? 1U : 0U;
        if (iwc_is(&assumptions, path, "contradicted")) {
            report_contradiction(&assumptions, items[i], machine);
        }
    }
    text_of(&assumptions, ROLE, machine, text);
    machine->setpoint_current = strcmp(text, "setpoint") == 0;
    machine->radius_mm = value_of(&assumptions, RADIUS, machine, 192);
    machine->track_mm = value_of(&assumptions, TRACK, machine, 0);
    text_of(&assumptions, GEAR, machine, text);
    const double turns = strtod(text, &slash);
    const double per = (*slash == '/') ? strtod(slash + 1, NULL) : 1.0;
    const double rotor_turns = (turns > 0.0 && per > 0.0) ? turns / per : 1.0;
    machine->measures = (ros_measures_t){
        .radius_confirmed = is_confirmed(&assumptions, "wheel_radius"),
        .track_confirmed = is_confirmed(&assumptions, "track"),
        .tick_m = 2.0 * M_PI * (double)machine->radius_mm / 1000.0 / TICKS_PER_TURN / rotor_turns,
        .track_m = (double)machine->track_mm / 1000.0,
    };
}
