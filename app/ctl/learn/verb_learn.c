// SPDX-License-Identifier: MIT
#include "learn.h"
#include "recordings/recording.h"
#include "talk/ctl.h"

#include <string.h>

int verb_learn(ctl_t *self, int count, char **words) {
    static learn_t learn;
    static recording_t recording;
    candump_t frame;
    if (count != 1 || (words[0][0] == '-' && words[0][1] != '\0')) {
        return ctl_fail(CTL_USAGE, "learn wants one recording (or -); see: iwheelctl learn --help");
    }
    int code = recording_open(&recording, words[0]);
    if (code != CTL_OK) {
        return code;
    }
    learn_init(&learn);
    while (recording_next(&recording, &frame)) {
        learn_frame(&learn, &frame);
    }
    const bool told = learn.setpoint[IW_LEFT].count + learn.setpoint[IW_RIGHT].count > 0U;
    if (self->json && !learn_report_json(&learn, recording.name)) {
        (void)recording_close(&recording);
        return ctl_fail(CTL_INTERNAL, "out of memory");
    }
    if (!self->json && learn.frames > 0U) {
        learn_report(&learn, recording.name);
    }
    code = recording_close(&recording);
    return (code != CTL_OK || told) ? code : CTL_NO;
}
