// SPDX-License-Identifier: MIT
// Byte 0 of a setpoint: the first of the two facts that are not in the document and without which no wheel can be
// driven.
//
// While the role of the current is unknown, bringup drives wheels as if the current were a setpoint: its zero is 0 mm/s
// with 0 mA, which is no torque in either role. With the other role, a zero with full current could be full torque.
#include "bringup.h"
#include "learn/learn.h"
#include "recordings/ctl_recording.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOVES_MM_S 40
/// Measured speed in percent of the command; within these bounds the wheel followed it. The radius may be different.
#define FOLLOWS_LOW   60
#define FOLLOWS_HIGH  150
#define PROBE_DEFAULT "0-7"

#define TYPES    256U
#define TYPE_MAX 255
#define DLC_MIN  5
#define DLC_MAX  8

typedef struct {
    learn_t learn;
    recording_t recording;
} study_t;

/// Result of the try of one type. After a stop, the other types are tried only after a further answer.
typedef enum { TRY_NEXT = 0, TRY_FOUND, TRY_STOPPED } try_t;

static bool both_move(const outcome_t *outcome) {
    return abs(outcome->mean_mm_s[IW_LEFT]) >= MOVES_MM_S && abs(outcome->mean_mm_s[IW_RIGHT]) >= MOVES_MM_S;
}

burst_t bringup_ahead(const bringup_t *self, unsigned for_ms) {
    return (burst_t){.speed_mm_s = {BRINGUP_SPEED_MM_S, BRINGUP_SPEED_MM_S},
                     .current_mA = {self->current_mA, self->current_mA},
                     .has_current = true,
                     .for_ms = for_ms};
}

void bringup_start_with(bringup_t *self, int type) {
    gateway_config_t config = self->config;
    config.core.setpoint_type = (uint8_t)type;
    config.core.setpoint_type_set = true;
    config.core.current_role = IW_ROLE_SETPOINT;
    trial_start(self, &config);
}

/// Returns true if both wheels followed the command. A type that means speed turns a wheel about as fast as commanded;
/// other types may turn it as well.
static bool is_followed(const outcome_t *outcome) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const int speed = abs(outcome->mean_mm_s[side]);
        if (speed < BRINGUP_SPEED_MM_S * FOLLOWS_LOW / 100 || speed > BRINGUP_SPEED_MM_S * FOLLOWS_HIGH / 100) {
            return false;
        }
    }
    return true;
}

static void keep_type(bringup_t *self, int type, const outcome_t *outcome) {
    const bool followed = is_followed(outcome);
    self->config.core.setpoint_type = (uint8_t)type;
    self->config.core.setpoint_type_set = true;
    bringup_note(self, "wheels", "setpoint_type", followed ? "setpoint_type" : NULL,
                 "both wheels turned with it%s: commanded %d mm/s, measured %d and %d",
                 followed ? "" : ", but at another speed", BRINGUP_SPEED_MM_S, outcome->mean_mm_s[IW_LEFT],
                 outcome->mean_mm_s[IW_RIGHT]);
    if (!followed) {
        talk_print("Commanded %d mm/s, measured %d and %d: the gear is unknown, or this type does not mean speed. "
                   "Bringup uses the type and notes it as not confirmed.",
                   BRINGUP_SPEED_MM_S, outcome->mean_mm_s[IW_LEFT], outcome->mean_mm_s[IW_RIGHT]);
    }
}

/// Tries one type. It is found if both wheels turned and the operator saw it.
static try_t try_type(bringup_t *self, int type) {
    outcome_t outcome;
    const burst_t burst = bringup_ahead(self, BRINGUP_PROBE_MS);
    bringup_start_with(self, type);
    (void)printf("type %d:\n", type);
    if (!burst_show(self, &burst, &outcome)) {
        return TRY_STOPPED;
    }
    if (!both_move(&outcome)) {
        const bool left = abs(outcome.mean_mm_s[IW_LEFT]) >= MOVES_MM_S;
        if (left || abs(outcome.mean_mm_s[IW_RIGHT]) >= MOVES_MM_S) {
            talk_print("  Only the %s wheel turned: is the other one blocked, or switched off?",
                       text_side(left ? IW_LEFT : IW_RIGHT));
        }
        return TRY_NEXT;
    }
    const bool seen = talk_yes(self, "Did both wheels turn, slowly and evenly?", true);
    if (seen) {
        keep_type(self, type, &outcome);
    }
    return seen ? TRY_FOUND : TRY_NEXT;
}

/// Parses text such as "3", "0-7" or "1,4,9-12" into one flag per type. Returns false if it is not valid.
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

/// Tries the types until one is found or stopped. Returns true if one is found.
static bool try_types(bringup_t *self, const bool *wanted) {
    for (int type = 0; type <= TYPE_MAX; type++) {
        const try_t tried = wanted[type] ? try_type(self, type) : TRY_NEXT;
        if (tried == TRY_STOPPED) {
            talk_print("Type %d was not tried to its end. Write the types to try next.", type);
        }
        if (tried != TRY_NEXT) {
            return tried == TRY_FOUND;
        }
    }
    talk_print("None of these moved both wheels. Other types may; or the wheels need more current (--current, now "
               "%d mA); or they accept no commands at all: is their enable switch on?",
               self->current_mA);
    return false;
}

/// Lists the types that were sent with a speed, most frequent first, as many as fit and at most four: "3" or "3,1".
/// Returns the number of their frames; if it is 0, `out_list` is unchanged.
static uint64_t list_types(const learn_t *learn, char *out_list, size_t size) {
    uint64_t left[TYPES];
    uint64_t frames = 0;
    size_t used = 0;
    for (unsigned type = 0; type < TYPES; type++) {
        left[type] = learn->setpoint[IW_LEFT].type_moving[type] + learn->setpoint[IW_RIGHT].type_moving[type];
        frames += left[type];
    }
    if (frames > 0U) {
        out_list[0] = '\0';
    }
    for (unsigned rank = 0; rank < 4U; rank++) {
        unsigned best = 0;
        for (unsigned type = 1; type < TYPES; type++) {
            if (left[type] > left[best]) {
                best = type;
            }
        }
        if (left[best] == 0U) {
            break;
        }
        const int n = snprintf(&out_list[used], size - used, "%s%u", (used > 0U) ? "," : "", best);
        used += (n > 0 && (size_t)n < size - used) ? (size_t)n : 0U;
        left[best] = 0U;
    }
    return frames;
}

/// Uses the length of the recorded setpoints if it is longer than documented: the other controller had a reason for it.
static void take_length(bringup_t *self, const learn_t *learn) {
    const learn_range_t *left = &learn_known(learn, IW_ID_LEFT_SETPOINT)->length;
    const learn_range_t *right = &learn_known(learn, IW_ID_RIGHT_SETPOINT)->length;
    const int low = (left->low < right->low) ? left->low : right->low;
    const int high = (left->high > right->high) ? left->high : right->high;
    const bool both = learn->setpoint[IW_LEFT].count > 0U && learn->setpoint[IW_RIGHT].count > 0U;
    if (both && low == high && low > DLC_MIN && low <= DLC_MAX) {
        self->config.core.setpoint_dlc = (uint16_t)low;
        bringup_note(self, "wheels", "setpoint_dlc", NULL, "every setpoint of the recording has %d bytes", low);
        talk_print("All of them have %d bytes, so the gateway will send as many (setpoint_dlc).", low);
    } else if (high > DLC_MIN) {
        talk_print("They have %d to %d bytes, or only one wheel received any: the length stays %u (setpoint_dlc).", low,
                   high, self->config.core.setpoint_dlc);
    }
}

/// Reads suggestions from a recording of another controller, as `learn` does: the setpoint types, such as "3,1", and
/// the length. They are suggestions only: the wheels decide. Prints a message if there are none.
static void learn_from_recording(bringup_t *self, char *out_types, size_t size) {
    study_t *study = calloc(1, sizeof(*study));
    candump_t frame;
    if (study != NULL && recording_open(&study->recording, NULL, self->recording) == CTL_OK) {
        learn_init(&study->learn);
        while (recording_next(&study->recording, &frame)) {
            learn_frame(&study->learn, &frame);
        }
        (void)recording_close(&study->recording);
        const uint64_t frames = list_types(&study->learn, out_types, size);
        if (frames > 0U) {
            talk_print("In %s %" PRIu64
                       " setpoints have a speed, with type %s. They were sent; that is no proof that the wheels "
                       "followed (see: iwheelctl learn).",
                       self->recording, frames, out_types);
            if (study->learn.setpoint[IW_LEFT].sent + study->learn.setpoint[IW_RIGHT].sent > 0U) {
                talk_print(
                    "Some are marked as sent by the program that recorded them: if that was this gateway, they only "
                    "repeat its configuration.");
            }
            take_length(self, &study->learn);
        } else {
            talk_print("%s has no setpoint with a speed, so it suggests no type.", self->recording);
        }
    }
    free(study);
}

void bringup_type(bringup_t *self) {
    char answer[BRINGUP_ANSWER_SIZE];
    char suggestion[24] = PROBE_DEFAULT;
    bool wanted[TYPE_MAX + 1];
    bool found = false;
    talk_step(4, "the setpoint type (WHEELS TURN, in the air)");
    if (self->config.core.setpoint_type_set) {
        (void)snprintf(suggestion, sizeof suggestion, "%u", self->config.core.setpoint_type);
    }
    if (self->recording != NULL) {
        learn_from_recording(self, suggestion, sizeof suggestion);
    }
    talk_print(
        "Byte 0 of every setpoint is a type whose values the wheels' document does not list. Write the type that "
        "you know (from the maker, or from a recording: --learn FILE), or the types to try, such as 0-7 or 1,4. "
        "Each is tried for %.1f s at %d mm/s with at most %d mA, until one moves both wheels.",
        BRINGUP_PROBE_MS / 1e3, BRINGUP_SPEED_MM_S, self->current_mA);
    while (!found) {
        talk_ask(self, "Setpoint type, or types to try", suggestion, answer);
        if (parse_types(answer, wanted)) {
            found = try_types(self, wanted);
        } else {
            talk_print("Types are numbers from 0 to %d: 3, 0-7 or 1,4,9-12.", TYPE_MAX);
        }
    }
}
