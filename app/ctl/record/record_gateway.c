// SPDX-License-Identifier: MIT
// Recording what a running gateway sees: it tells each frame, received and sent.
#include "decode/frame_json.h"
#include "recorder.h"

#include <string.h>

#define LOOK_US 500000

/// True if it could be written.
static bool take_event(recorder_t *self, const json_t *line) {
    const char *event = json_string_value(json_object_get(line, "event"));
    int64_t at_us = 0;
    if (event != NULL && strcmp(event, "lost") == 0) {
        const json_int_t count = json_integer_value(json_object_get(line, "count"));
        self->lost += (count > 0) ? (uint64_t)count : 0U;
    }
    if (event == NULL || strcmp(event, "frame") != 0) {
        return true;
    }
    const candump_t frame = frame_from_json(line, &at_us);
    return recorder_put(self, &frame, at_us);
}

int recorder_from_gateway(ctl_t *ctl, recorder_t *self) {
    json_t *reply = NULL;
    int code = ctl_ask(ctl, json_pack("{s:s,s:[s]}", "cmd", "watch", "topics", "frame"), &reply);
    json_decref(reply);
    bool written = true;
    while (code == CTL_OK && written && client_now_us() < self->end_us) {
        json_t *line = NULL;
        const int64_t look_us = client_now_us() + LOOK_US;
        const iwc_result_t result =
            client_receive(&ctl->client, (look_us < self->end_us) ? look_us : self->end_us, &line);
        written = result != IWC_OK || take_event(self, line);
        written = recorder_tend(self) && written;
        json_decref(line);
        if (result == IWC_INTERRUPTED) {
            break;
        }
        if (result != IWC_OK && result != IWC_TIMEOUT) {
            code = ctl_lost(ctl, result);
        }
    }
    return code;
}
