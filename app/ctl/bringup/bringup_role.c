// SPDX-License-Identifier: MIT
// Role of the current in a setpoint: tries with only current or speed, and a last try with both. Without the last try,
// wheels that cannot turn at all would count as a limit.
//
//     current alone turns both           -> setpoint
//     neither alone, nor 0 with current,
//         but both together turn both    -> limit
//     any other result                   -> not measured; the operator may know
#include "bringup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TORQUE_MS   400U
#define ZERO_MS     1000U
#define TORQUE_MM_S 25
#define LEFT        (1U << IW_LEFT)
#define RIGHT       (1U << IW_RIGHT)
#define BOTH        (LEFT | RIGHT)

/// Result of the tries.
typedef struct {
    const char *role; ///< "limit", "setpoint", or "?".
    bool seen;        ///< All results that show this role were observed, on both wheels.
    char how[BRINGUP_NOTE_SIZE];
} role_t;

/// Returns a bit per side that turned.
static unsigned turned(const outcome_t *outcome) {
    return ((abs(outcome->peak_mm_s[IW_LEFT]) >= TORQUE_MM_S) ? LEFT : 0U) |
           ((abs(outcome->peak_mm_s[IW_RIGHT]) >= TORQUE_MM_S) ? RIGHT : 0U);
}

static const char *wheels(unsigned sides) {
    return (sides == BOTH)    ? "both wheels"
           : (sides == LEFT)  ? "the left wheel"
           : (sides == RIGHT) ? "the right wheel"
                              : "no wheel";
}

/// Runs the burst and returns the sides that turned.
static unsigned try_burst(bringup_t *self, const burst_t *burst) {
    outcome_t outcome = {0};
    burst_insist(self, burst, &outcome);
    return turned(&outcome);
}

/// Stores the role setpoint: a current without a speed turned the wheels in `sides`.
static void find_setpoint(role_t *found, unsigned sides, int current_mA) {
    found->role = "setpoint";
    found->seen = sides == BOTH;
    (void)snprintf(found->how, sizeof found->how, "%d mA without speed turned %s", current_mA, wheels(sides));
    if (!found->seen) {
        talk_print(
            "Only %s turned: the other one may be blocked. A current that turns a wheel without a speed is no limit, "
            "but only one wheel showed it.",
            wheels(sides));
    }
}

/// Tries a zero as the role limit sends it: speed 0 with current. If it turns a wheel, the role is setpoint. Returns
/// the sides that turned.
static unsigned try_zero(bringup_t *self) {
    gateway_config_t config = self->config;
    const burst_t zero = {.for_ms = ZERO_MS, .enough_mm_s = TORQUE_MM_S};
    config.core.current_role = IW_ROLE_LIMIT;
    talk_print("Now speed 0 with %d mA, the zero of the role limit. Neither wheel may turn.", self->current_mA);
    trial_start(self, &config);
    return try_burst(self, &zero);
}

/// Tries both together, after neither alone turned a wheel: the current is a limit only if both together still turn the
/// wheels.
static void try_limit(bringup_t *self, role_t *found) {
    const burst_t together = bringup_ahead(self, BRINGUP_PROBE_MS / 2U);
    unsigned sides = try_zero(self);
    if (sides != 0U) {
        talk_print("It TURNED %s: the current is a setpoint after all.", wheels(sides));
        find_setpoint(found, sides, self->current_mA);
        return;
    }
    talk_print("Neither wheel turned. Finally speed and current together; the result counts only if both wheels turn.");
    bringup_start_with(self, self->config.core.setpoint_type);
    sides = try_burst(self, &together);
    found->seen = sides == BOTH;
    if (found->seen) {
        found->role = "limit";
        (void)snprintf(found->how, sizeof found->how,
                       "%d mA alone and %d mm/s alone turned no wheel, both together turned both", self->current_mA,
                       BRINGUP_SPEED_MM_S);
        talk_print("The wheels turn with both together, and with neither alone: the current is a limit.");
    } else {
        talk_print(
            "Now %s turned, so a wheel was blocked and the earlier tries have no result. Free the wheels and start "
            "bringup again, or answer from other information.",
            wheels(sides));
    }
}

static void find_role(bringup_t *self, role_t *found) {
    const int current_mA = self->current_mA / 2;
    const burst_t current_only = {
        .current_mA = {current_mA, current_mA}, .has_current = true, .for_ms = TORQUE_MS, .enough_mm_s = TORQUE_MM_S};
    const burst_t speed_only = {
        .speed_mm_s = {BRINGUP_SPEED_MM_S, BRINGUP_SPEED_MM_S}, .has_current = true, .for_ms = BRINGUP_PROBE_MS / 2U};
    const unsigned by_current = try_burst(self, &current_only);
    const unsigned by_speed = try_burst(self, &speed_only);
    if (by_current != 0U) {
        talk_print("The current alone turned %s: it is a setpoint.", wheels(by_current));
        find_setpoint(found, by_current, current_mA);
    } else if (by_speed != 0U) {
        talk_print(
            "The speed without current turned %s, and the current alone turned none: the current seems to have no "
            "effect. Ask the maker; in this case the usual role is limit.",
            wheels(by_speed));
    } else {
        talk_print("Neither alone turned a wheel: the current may be a limit.");
        try_limit(self, found);
    }
}

static void keep_role(bringup_t *self, const role_t *found) {
    char answer[BRINGUP_ANSWER_SIZE];
    talk_ask(self, "current_role (limit or setpoint)", found->role, answer);
    while (strcmp(answer, "limit") != 0 && strcmp(answer, "setpoint") != 0) {
        talk_print("Please write limit or setpoint: without one of them the wheels cannot be driven (q ends bringup).");
        talk_ask(self, "current_role (limit or setpoint)", found->role, answer);
    }
    const bool same = strcmp(answer, found->role) == 0;
    self->config.core.current_role = (strcmp(answer, "limit") == 0) ? IW_ROLE_LIMIT : IW_ROLE_SETPOINT;
    bringup_note(self, "wheels", "current_role", (same && found->seen) ? "current_role" : NULL, "%s",
                 same ? found->how : "typed by the operator; the wheels did not show it");
}

void bringup_role(bringup_t *self) {
    char answer[BRINGUP_ANSWER_SIZE];
    role_t found = {.role = "?"};
    talk_step(5, "the role of the current (WHEELS MAY TURN, in the air)");
    talk_print(
        "A setpoint has a speed and a current. The current is either a limit of the motor's current, or a "
        "setpoint of its own. Two to four short tries show it: first %d mA without a speed, then %d mm/s without a "
        "current.",
        self->current_mA / 2, BRINGUP_SPEED_MM_S);
    bringup_start_with(self, self->config.core.setpoint_type);
    talk_ask(self, "Enter begins the tries", "go", answer);
    find_role(self, &found);
    keep_role(self, &found);
}
