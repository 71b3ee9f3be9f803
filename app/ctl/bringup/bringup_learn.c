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
            best = left[type] > left[best] ? type : best;
        }
        if (left[best] == 0U) {
            break;
        }
        const int n = snprintf(&out_list[used], size - used, "%s%u", used > 0U ? "," : "", best);
        used += n > 0 && (size_t)n < size - used ? (size_t)n : 0U;
        left[best] = 0U;
    }
    return frames;
}

/// Setpoints longer than documented are sent so: the other controller had its reasons.
static void take_length(bringup_t *self, const learn_t *learn) {
    const learn_id_t *left = learn_known(learn, IW_ID_LEFT_SETPOINT);
    if (left->count > 0U && left->length.low == left->length.high && left->length.low > DLC_MIN &&
        left->length.low <= DLC_MAX) {
        self->config.core.setpoint_dlc = (uint16_t)left->length.low;
        bringup_note(self, "wheels", "setpoint_dlc", NULL, "the other controller sent %d bytes", left->length.low);
        talk_say("Its setpoints have %d bytes, so ours get as many (setpoint_dlc).", left->length.low);
    }
}

bool bringup_learn(bringup_t *self, char *out_types, size_t size) {
    study_t *study = calloc(1, sizeof(*study));
    candump_t frame;
    bool found = false;
    if (study != NULL && recording_open(&study->recording, self->recording) == CTL_OK) {
        learn_init(&study->learn);
        while (recording_next(&study->recording, &frame)) {
            learn_frame(&study->learn, &frame);
        }
        (void)recording_close(&study->recording);
        const uint64_t frames = list_types(&study->learn, out_types, size);
        found = frames > 0U;
        if (found) {
            talk_say("In %s another controller drove with type %s (%" PRIu64 " setpoints with a speed).",
                     self->recording, out_types, frames);
            take_length(self, &study->learn);
        } else {
            talk_say("In %s nobody drove: there is no setpoint with a speed in it.", self->recording);
        }
    }
    free(study);
    return found;
}
