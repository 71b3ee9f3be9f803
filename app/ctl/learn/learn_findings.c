// SPDX-License-Identifier: MIT
#include "learn_findings.h"
#include "text/ctl_text.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

bool learn_is_empty(const learn_range_t *range) {
    return range->low > range->high;
}

learn_finding_t *learn_print(learn_findings_t *self, char mark, const char *item, unsigned side, const char *format,
                             ...) {
    // The list cannot overflow: each sentence is added once, or once per side.
    learn_finding_t *finding = &self->at[(self->count < LEARN_FINDINGS_MAX - 1U) ? self->count++ : self->count];
    va_list list;
    *finding = (learn_finding_t){.mark = mark, .item = item, .side = side};
    va_start(list, format);
    (void)vsnprintf(finding->text, sizeof finding->text, format, list);
    va_end(list);
    return finding;
}

const learn_finding_t *learn_find(const learn_findings_t *self, const char *item, unsigned side) {
    for (unsigned i = 0; i < self->count; i++) {
        if (strcmp(self->at[i].item, item) == 0 && self->at[i].side == side) {
            return &self->at[i];
        }
    }
    return NULL;
}

bool learn_suggests(const learn_findings_t *self, const learn_finding_t *finding, const char **out_section,
                    const char **out_key) {
    // Without a type that moves the wheels, the meaning of the rest of a setpoint is not known.
    static const struct {
        const char *item;
        const char *section; ///< NULL: the section of its side.
        bool needs_type;
    } keys[] = {{"setpoint_type", "wheels", true},
                {"current_role", "wheels", true},
                {"setpoint_dlc", "wheels", true},
                {"force_unit", NULL, false},
                {"wheel_lag_ms", "limits", false}};
    const learn_finding_t *type = learn_find(self, "setpoint_type", LEARN_BOTH);
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++) {
        if (finding->value[0] != '\0' && strcmp(finding->item, keys[i].item) == 0) {
            *out_section = (keys[i].section != NULL) ? keys[i].section : text_side(finding->side);
            *out_key = keys[i].item;
            return !keys[i].needs_type || (type != NULL && type->mark == '+');
        }
    }
    return false;
}

static void weigh_frames(const learn_t *self, learn_findings_t *out) {
    if (self->strange > 0U) {
        (void)learn_print(
            out, '-', "frames", LEARN_BOTH,
            "%" PRIu64
            " remote, extended or FD frames with one of the eleven numbers: the gateway ignores them. python-can "
            "sends extended ids by default: is_extended_id=False",
            self->strange);
    }
    if (self->too_short > 0U) {
        (void)learn_print(out, '-', "frames", LEARN_BOTH,
                          "%" PRIu64 " frames are shorter than in the document: the gateway ignores them",
                          self->too_short);
    }
    if (self->errors > 0U) {
        (void)learn_print(out, '-', "bus", LEARN_BOTH,
                          "%" PRIu64 " reports of errors on the bus: cable, termination, bit rate?", self->errors);
    }
    if (self->backwards > 0U) {
        (void)learn_print(out, '-', "time", LEARN_BOTH,
                          "time goes back %" PRIu64
                          " times: does the file contain several recordings? The periods are not reliable",
                          self->backwards);
    }
}

static void weigh_oddities(const learn_t *self, unsigned side, learn_findings_t *out) {
    const learn_setpoint_t *setpoint = &self->setpoint[side];
    const int64_t longest_us = self->known[side].period.longest_us;
    if (setpoint->over_limit > 0U) {
        (void)learn_print(out, '-', "current", side,
                          "%s: %" PRIu64 " setpoints with a current beyond the documented +/-2000 mA", text_side(side),
                          setpoint->over_limit);
    }
    if (setpoint->padding > 0U) {
        (void)learn_print(out, '-', "padding", side,
                          "%s: %" PRIu64 " setpoints have nonzero bytes after the five documented ones",
                          text_side(side), setpoint->padding);
    }
    if (longest_us > (int64_t)IW_WHEEL_WATCHDOG_US) {
        (void)learn_print(out, '-', "silence", side,
                          "%s: up to %" PRId64
                          " ms without a setpoint; according to the document a wheel stops on its own after 1000 ms",
                          text_side(side), longest_us / 1000);
    }
}

void learn_weigh(const learn_t *self, learn_findings_t *out_findings) {
    out_findings->count = 0;
    weigh_frames(self, out_findings);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        weigh_oddities(self, side, out_findings);
    }
    learn_weigh_setpoints(self, out_findings);
    learn_weigh_wheels(self, out_findings);
    (void)learn_print(
        out_findings, '?', "mounting", LEARN_BOTH,
        "mirrored mounting, radius, track and the meaning of byte 0: no recording shows them; use iwheelctl "
        "bringup");
}
