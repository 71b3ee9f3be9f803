// SPDX-License-Identifier: MIT
// What a recording of another controller suggests, as `learn` reads it. Suggestions only: the wheels have the last word.
#include "bringup.h"
#include "learn/learn.h"
#include "recordings/recording.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#define TYPES   256U
#define DLC_MIN 5
#define DLC_MAX 8

typedef struct {
    learn_t learn;
    recording_t recording;
} study_t;

/// The types that were sent with a speed, most frequent first as far as there is room: "3" or "3,1".
static uint64_t list_types(const learn_t *learn, char *out_list, size_t size) {
    uint64_t left[TYPES];
    uint64_t frames = 0;
    size_t used = 0;
    for (unsigned type = 0; type < TYPES; type++) {
        left[type] = learn->setpoint[IW_LEFT].type_moving[type] + learn->setpoint[IW_RIGHT].type_moving[type];
        frames += left[type];
    }
    out_list[0] = '\0';
    for (unsigned rank = 0; rank < 4U; rank++) {
        unsigned best = 0;
        for (unsigned type = 1; type < TYPES; type++) {
            best = (left[type] > left[best]) ? type : best;
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

/// Setpoints longer than documented are sent so: the other controller had its reasons.
static void take_length(bringup_t *self, const learn_t *learn) {
    const learn_range_t *left = &learn_known(learn, IW_ID_LEFT_SETPOINT)->length;
    const learn_range_t *right = &learn_known(learn, IW_ID_RIGHT_SETPOINT)->length;
    const int low = (left->low < right->low) ? left->low : right->low;
    const int high = (left->high > right->high) ? left->high : right->high;
    const bool both = learn->setpoint[IW_LEFT].count > 0U && learn->setpoint[IW_RIGHT].count > 0U;
    if (both && low == high && low > DLC_MIN && low <= DLC_MAX) {
        self->config.core.setpoint_dlc = (uint16_t)low;
        bringup_note(self, "wheels", "setpoint_dlc", NULL, "every setpoint of the recording has %d bytes", low);
        talk_say("All of them have %d bytes, so ours get as many (setpoint_dlc).", low);
    } else if (high > DLC_MIN) {
        talk_say("They have %d to %d bytes, or only one wheel got any: the length stays %u (setpoint_dlc).", low, high,
                 self->config.core.setpoint_dlc);
    }
}

void bringup_learn(bringup_t *self, char *out_types, size_t size) {
    study_t *study = calloc(1, sizeof(*study));
    candump_t frame;
    if (study != NULL && recording_open(&study->recording, self->recording) == CTL_OK) {
        learn_init(&study->learn);
        while (recording_next(&study->recording, &frame)) {
            learn_frame(&study->learn, &frame);
        }
        (void)recording_close(&study->recording);
        const uint64_t frames = list_types(&study->learn, out_types, size);
        if (frames > 0U) {
            talk_say("In %s %" PRIu64 " setpoints have a speed, with type %s. That is what was sent, no proof that the "
                     "wheels turned by it (iwheelctl learn tells).",
                     self->recording, frames, out_types);
            if (study->learn.setpoint[IW_LEFT].sent + study->learn.setpoint[IW_RIGHT].sent > 0U) {
                talk_say("Some are marked as sent by the program that recorded them: if that was this gateway, they "
                         "repeat its configuration.");
            }
            take_length(self, &study->learn);
        } else {
            talk_say("In %s there is no setpoint with a speed: it suggests nothing.", self->recording);
        }
    }
    free(study);
}
