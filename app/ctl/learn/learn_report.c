// SPDX-License-Identifier: MIT
#include "learn_report.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>

#define CELL 26

static const char *const sides[] = {"left", "right"};

static bool is_empty(const learn_range_t *range) {
    return range->low > range->high;
}

static void range_text(const learn_range_t *range, const char *unit, char *out) {
    if (is_empty(range)) {
        (void)snprintf(out, LEARN_TEXT, "--");
    } else if (range->low == range->high) {
        (void)snprintf(out, LEARN_TEXT, "always %" PRId32 "%s", range->low, unit);
    } else {
        (void)snprintf(out, LEARN_TEXT, "%" PRId32 " to %" PRId32 "%s", range->low, range->high, unit);
    }
}

static void types_text(const learn_setpoint_t *setpoint, char *out) {
    size_t used = 0;
    unsigned kinds = 0;
    out[0] = '\0';
    for (unsigned type = 0; type < 256U; type++) {
        if (setpoint->type[type] > 0U && used < LEARN_TEXT - 32U) {
            const int n = snprintf(out + used, LEARN_TEXT - used, "%s%u (%u %%)", kinds > 0U ? ", " : "", type,
                                   (unsigned)(setpoint->type[type] * 100U / setpoint->count));
            used += n > 0 ? (size_t)n : 0U;
            kinds++;
        }
    }
    if (kinds == 0U) {
        (void)snprintf(out, LEARN_TEXT, "--");
    }
}

static void period_text(const learn_period_t *period, char *out) {
    const uint32_t ms = learn_period_ms(period);
    if (ms == 0U && period->counted < 2U) {
        (void)snprintf(out, LEARN_TEXT, "--");
    } else {
        (void)snprintf(out, LEARN_TEXT, "%" PRIu32 " ms, longest %" PRId64 " ms", ms, period->longest_us / 1000);
    }
}

static void row(const char *label, const char *left, const char *right) {
    (void)printf("  %-10s %-*s %s\n", label, CELL, left, right);
}

static void print_setpoints(const learn_t *self) {
    char text[2][LEARN_TEXT];
    const learn_setpoint_t *each = self->setpoint;
    (void)printf("\nSetpoints    left 266 (0x10A)%*sright 298 (0x12A)\n", CELL - 15, "");
    for (unsigned side = 0; side < IW_SIDES; side++) {
        (void)snprintf(text[side], LEARN_TEXT, "%" PRIu64, each[side].count);
    }
    row("frames", text[0], text[1]);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        types_text(&each[side], text[side]);
    }
    row("type", text[0], text[1]);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        range_text(&each[side].speed_mm_s, " mm/s", text[side]);
    }
    row("speed", text[0], text[1]);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        range_text(&each[side].current_mA, " mA", text[side]);
    }
    row("current", text[0], text[1]);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        range_text(&self->known[side].length, " bytes", text[side]);
    }
    row("length", text[0], text[1]);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        period_text(&self->known[side].period, text[side]);
    }
    row("period", text[0], text[1]);
}

static void print_id(const learn_id_t *id, const char *said) {
    char length[LEARN_TEXT];
    char period[LEARN_TEXT];
    range_text(&id->length, " bytes", length);
    period_text(&id->period, period);
    (void)printf("  %4" PRIu32 " (0x%0*" PRIX32 ")  %8" PRIu64 "  %-18s %-26s %s\n", id->id, id->extended ? 8 : 3,
                 id->id, id->count, length, period, said);
}

static void print_telemetry(const learn_t *self) {
    static const char *const documented[LEARN_IDS] = {
        "",
        "",
        "document: 4 bytes, 4 ms",
        "document: 4 bytes, 4 ms",
        "document: 7 bytes, 40 ms",
        "document: 7 bytes, 40 ms",
        "document: 8 bytes, 40 ms",
        "document: 4 bytes, 50 ms",
        "document: 4 bytes, 50 ms",
        "document: 2 bytes, 1000 ms, first 60 s",
        "document: 2 bytes, 1000 ms, first 60 s",
    };
    (void)puts("\nTelemetry      frames  length             period");
    for (unsigned i = 2; i < LEARN_IDS; i++) {
        print_id(&self->known[i], documented[i]);
    }
    if (self->others > 0U) {
        (void)puts("\nOther ids, not in the document");
    }
    for (uint32_t i = 0; i < self->others; i++) {
        print_id(&self->other[i], "");
    }
    if (self->more_others > 0U) {
        (void)printf("  and %" PRIu64 " frames of still other ids\n", self->more_others);
    }
}

void learn_say(char mark, const char *format, ...) {
    va_list list;
    (void)printf("  %c ", mark);
    va_start(list, format);
    (void)vprintf(format, list);
    va_end(list);
    (void)putchar('\n');
}

static void say_oddities(const learn_t *self) {
    if (self->strange > 0U) {
        learn_say('-',
                  "%" PRIu64 " remote, extended or FD frames with one of the eleven numbers: the gateway ignores such",
                  self->strange);
    }
    if (self->too_short > 0U) {
        learn_say('-', "%" PRIu64 " frames are shorter than the document says: the gateway ignores such",
                  self->too_short);
    }
    if (self->errors > 0U) {
        learn_say('-', "%" PRIu64 " reports of errors on the bus: cable, termination, bit rate?", self->errors);
    }
    if (self->backwards > 0U) {
        learn_say('-', "time goes back %" PRIu64 " times: several recordings in one file? periods are doubtful",
                  self->backwards);
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const learn_setpoint_t *setpoint = &self->setpoint[side];
        if (setpoint->over_limit > 0U) {
            learn_say('-', "%s: %" PRIu64 " setpoints with a current beyond the documented +/-2000 mA", sides[side],
                      setpoint->over_limit);
        }
        if (setpoint->padding > 0U) {
            learn_say('-', "%s: %" PRIu64 " setpoints have something behind the five documented bytes", sides[side],
                      setpoint->padding);
        }
        if (self->known[side].period.longest_us > (int64_t)IW_WHEEL_WATCHDOG_US) {
            learn_say('-', "%s: up to %" PRId64 " ms without a setpoint: the wheel stopped by itself after 1000 ms",
                      sides[side], self->known[side].period.longest_us / 1000);
        }
    }
}

bool learn_report(const learn_t *self, const char *name) {
    const int64_t ms = (self->last_us - self->first_us) / 1000;
    const uint64_t setpoints = self->setpoint[IW_LEFT].count + self->setpoint[IW_RIGHT].count;
    (void)printf("%s: %" PRIu64 " frames in %" PRId64 ".%" PRId64 " s\n", name, self->frames, ms / 1000,
                 (ms < 0 ? -ms : ms) % 1000 / 100);
    print_setpoints(self);
    print_telemetry(self);
    (void)puts("\nWhat it tells (+ speaks for, - speaks against, ? says nothing about)");
    say_oddities(self);
    learn_say_type(self);
    learn_say_role(self);
    learn_say_signs(self);
    learn_say_scale(self);
    learn_say_force(self);
    learn_say_pose(self);
    learn_say('?', "whether a wheel is mounted mirrored, its radius, what byte 0 means: no recording tells; "
                   "iwheelctl bringup");
    learn_suggest(self);
    return setpoints > 0U;
}
