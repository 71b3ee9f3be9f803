// SPDX-License-Identifier: MIT
// Byte 0 of a setpoint, and what the current beside the speed means: the two things that the document leaves out and that
// nothing can be driven without.
//
// While the role is unknown, wheels are driven as if the current were a setpoint: its zero is 0 mm/s with 0 mA, which is
// no torque whichever role is right. The other way round, a zero with full current could be full torque.
#include "bringup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TYPE_MAX      255
#define PROBE_MS      1200U
#define TORQUE_MS     400U
#define ZERO_MS       1000U
#define MOVES_MM_S    40
#define TORQUE_MM_S   25
#define PROBE_DEFAULT "0-7"

static bool both_move(const outcome_t *outcome) {
    return abs(outcome->mean_mm_s[IW_LEFT]) >= MOVES_MM_S && abs(outcome->mean_mm_s[IW_RIGHT]) >= MOVES_MM_S;
}

static burst_t ahead(const bringup_t *self, unsigned for_ms) {
    return (burst_t){.speed_mm_s = {BRINGUP_SPEED_MM_S, BRINGUP_SPEED_MM_S},
                     .current_mA = {self->current_mA, self->current_mA},
                     .has_current = true,
                     .for_ms = for_ms};
}

/// A gateway that sends this type, with the role under which a zero surely is no torque.
static bool start_with(bringup_t *self, int type) {
    gateway_config_t config = self->config;
    config.core.setpoint_type = (uint8_t)type;
    config.core.setpoint_type_set = true;
    config.core.current_role = IW_ROLE_SETPOINT;
    return trial_start(self, &config, false);
}

static void keep_type(bringup_t *self, int type, const outcome_t *outcome) {
    self->config.core.setpoint_type = (uint8_t)type;
    self->config.core.setpoint_type_set = true;
    bringup_note(self, "wheels", "setpoint_type", "setpoint_type",
                 "both wheels turned with it: told %d mm/s, measured %d and %d", BRINGUP_SPEED_MM_S,
                 outcome->mean_mm_s[IW_LEFT], outcome->mean_mm_s[IW_RIGHT]);
}

/// Tries one type. `*out_found`: both wheels turned and the operator saw it.
static bringup_result_t try_type(bringup_t *self, int type, bool *out_found) {
    outcome_t outcome;
    const burst_t burst = ahead(self, PROBE_MS);
    *out_found = false;
    if (!start_with(self, type)) {
        return BRINGUP_FAILED;
    }
    (void)printf("type %d:\n", type);
    const bringup_result_t shown = burst_show(self, &burst, &outcome);
    if (shown == BRINGUP_QUIT) {
        return BRINGUP_QUIT;
    }
    if (shown == BRINGUP_FAILED || !both_move(&outcome)) {
        return BRINGUP_ON;
    }
    if (!talk_yes("Did both wheels turn, slowly and evenly?", true, out_found)) {
        return BRINGUP_QUIT;
    }
    if (*out_found) {
        keep_type(self, type, &outcome);
    }
    return BRINGUP_ON;
}

/// "3", "0-7", "1,4,9-12" into one flag per type. False if it is none of these.
static bool parse_types(const char *text, bool wanted[TYPE_MAX + 1]) {
    const char *at = text;
    memset(wanted, 0, sizeof(bool) * (TYPE_MAX + 1));
    for (;;) {
        char *end = NULL;
        const long first = strtol(at, &end, 10);
        long last = first;
        if (end == at || first < 0 || first > TYPE_MAX) {
            return false;
        }
        if (*end == '-') {
            at = end + 1;
            last = strtol(at, &end, 10);
            if (end == at || last < first || last > TYPE_MAX) {
                return false;
            }
        }
        for (long type = first; type <= last; type++) {
            wanted[type] = true;
        }
        if (*end == '\0') {
            return true;
        }
        if (*end != ',') {
            return false;
        }
        at = end + 1;
    }
}

static bringup_result_t try_types(bringup_t *self, const bool *wanted, bool *out_found) {
    *out_found = false;
    for (int type = 0; type <= TYPE_MAX && !*out_found; type++) {
        const bringup_result_t result = wanted[type] ? try_type(self, type, out_found) : BRINGUP_ON;
        if (result != BRINGUP_ON) {
            return result;
        }
    }
    if (!*out_found) {
        talk_say("None of these moved both wheels. Other types may; or the wheels need more current (--current, now "
                 "%d mA); or they do not take commands at all: is their enable switch on?",
                 self->current_mA);
    }
    return BRINGUP_ON;
}

bringup_result_t bringup_type(bringup_t *self) {
    char answer[BRINGUP_ANSWER_SIZE];
    char suggestion[24] = PROBE_DEFAULT;
    bool wanted[TYPE_MAX + 1];
    bool found = false;
    talk_step(4, "the setpoint type (WHEELS TURN, in the air)");
    if (self->config.core.setpoint_type_set) {
        (void)snprintf(suggestion, sizeof(suggestion), "%u", self->config.core.setpoint_type);
    }
    if (self->recording != NULL) {
        (void)bringup_learn(self, suggestion, sizeof(suggestion));
    }
    talk_say("Byte 0 of every setpoint is a type whose values the wheels' document does not list. Write the one you "
             "know (from the maker, or from a recording: --learn FILE), or the ones to try, such as 0-7 or 1,4. Each "
             "is tried for %.1f s at %d mm/s with at most %d mA, until one moves both wheels.",
             PROBE_MS / 1e3, BRINGUP_SPEED_MM_S, self->current_mA);
    while (!found) {
        if (!talk_ask("Setpoint type, or types to try", suggestion, answer)) {
            return BRINGUP_QUIT;
        }
        if (!parse_types(answer, wanted)) {
            talk_say("Types are numbers from 0 to %d: 3, 0-7 or 1,4,9-12.", TYPE_MAX);
            continue;
        }
        const bringup_result_t result = try_types(self, wanted, &found);
        if (result != BRINGUP_ON) {
            return result;
        }
    }
    return BRINGUP_ON;
}

/// Under the role limit a zero is speed 0 with current. If that turns a wheel, the role is the other one. `*out_turned`.
static bringup_result_t try_zero(bringup_t *self, bool *out_turned) {
    gateway_config_t config = self->config;
    outcome_t outcome;
    const burst_t zero = {.for_ms = ZERO_MS, .enough_mm_s = TORQUE_MM_S};
    config.core.current_role = IW_ROLE_LIMIT;
    *out_turned = false;
    talk_say("Last, a zero as that role has it, speed 0 with %d mA. Nothing may turn.", self->current_mA);
    if (!trial_start(self, &config, false)) {
        return BRINGUP_FAILED;
    }
    const bringup_result_t shown = burst_show(self, &zero, &outcome);
    *out_turned = abs(outcome.peak_mm_s[IW_LEFT]) >= TORQUE_MM_S || abs(outcome.peak_mm_s[IW_RIGHT]) >= TORQUE_MM_S;
    return shown;
}

static const char *measured_role(bool torque, bool free) {
    if (torque) {
        return "setpoint";
    }
    return free ? "?" : "limit";
}

static bringup_result_t keep_role(bringup_t *self, const char *measured) {
    char answer[BRINGUP_ANSWER_SIZE];
    do {
        if (!talk_ask("current_role (limit or setpoint)", measured, answer)) {
            return BRINGUP_QUIT;
        }
    } while (strcmp(answer, "limit") != 0 && strcmp(answer, "setpoint") != 0);
    const bool same = strcmp(answer, measured) == 0;
    self->config.core.current_role = strcmp(answer, "limit") == 0 ? IW_ROLE_LIMIT : IW_ROLE_SETPOINT;
    bringup_note(self, "wheels", "current_role", same ? "current_role" : NULL,
                 !same                          ? "typed in; the wheels' behaviour did not show it"
                 : strcmp(answer, "limit") == 0 ? "a current without speed did not turn the wheels, a speed without "
                                                  "current neither"
                                                : "a current without speed turned the wheels");
    return BRINGUP_ON;
}

bringup_result_t bringup_role(bringup_t *self) {
    outcome_t torque;
    outcome_t unfed;
    const int current_mA = self->current_mA / 2;
    const burst_t current_only = {
        .current_mA = {current_mA, current_mA}, .has_current = true, .for_ms = TORQUE_MS, .enough_mm_s = TORQUE_MM_S};
    const burst_t speed_only = {
        .speed_mm_s = {BRINGUP_SPEED_MM_S, BRINGUP_SPEED_MM_S}, .has_current = true, .for_ms = PROBE_MS / 2U};
    talk_step(5, "what the current means (WHEELS MAY TURN, in the air)");
    talk_say("Beside the speed a setpoint has a current. Either it limits the motor's current, or it is a setpoint of "
             "its own. Two short tries tell: %d mA without a speed, then %d mm/s without a current.",
             current_mA, BRINGUP_SPEED_MM_S);
    if (!start_with(self, self->config.core.setpoint_type)) {
        return BRINGUP_FAILED;
    }
    bringup_result_t shown = burst_show(self, &current_only, &torque);
    shown = shown == BRINGUP_ON ? burst_show(self, &speed_only, &unfed) : shown;
    if (shown != BRINGUP_ON) {
        return shown;
    }
    const bool by_current =
        abs(torque.peak_mm_s[IW_LEFT]) >= TORQUE_MM_S || abs(torque.peak_mm_s[IW_RIGHT]) >= TORQUE_MM_S;
    const bool without = both_move(&unfed);
    bool turned = false;
    talk_say(by_current ? "The current alone turned them: it is a setpoint."
             : without  ? "They turn without current too, and not by current alone: it seems to mean nothing. Ask the "
                          "maker; limit is the usual word for that."
                        : "Neither turned them: the current seems to be a limit.");
    if (!by_current && !without) {
        shown = try_zero(self, &turned);
        if (shown != BRINGUP_ON) {
            return shown;
        }
        talk_say(turned ? "It TURNED: the current is a setpoint after all."
                        : "Nothing turned: the current is a limit.");
    }
    return keep_role(self, measured_role(by_current || turned, without));
}
