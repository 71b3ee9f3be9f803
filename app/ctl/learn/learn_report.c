// SPDX-License-Identifier: MIT
#include "learn_findings.h"

#include "text/text.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define CELL 26

static void range_text(const learn_range_t *range, const char *unit, char *out) {
    if (learn_is_empty(range)) {
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
            const int n = snprintf(out + used, LEARN_TEXT - used, "%s%u (%u %%)", (kinds > 0U) ? ", " : "", type,
                                   (unsigned)(setpoint->type[type] * 100U / setpoint->count));
            used += (n > 0) ? (size_t)n : 0U;
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

static void suggest(const learn_findings_t *findings) {
    const char *last = "";
    for (unsigned i = 0; i < findings->count; i++) {
        const char *section;
        const char *key;
        if (learn_suggests(findings, &findings->at[i], &section, &key)) {
            if (last[0] == '\0') {
                (void)puts(
                    "\nFor the configuration, as far as it goes (evidence, no proof; then: iwheelctl bringup)\n");
            }
            if (strcmp(section, last) != 0) {
                (void)printf("[%s]\n", section);
            }
            (void)printf("%s = %s\n", key, findings->at[i].value);
            last = section;
        }
    }
}

void learn_report(const learn_t *self, const char *name) {
    static learn_findings_t findings;
    const int64_t ms = (self->last_us - self->first_us) / 1000;
    text_line(stdout, "%s: %" PRIu64 " frames in %" PRId64 ".%" PRId64 " s", name, self->frames, ms / 1000,
              ((ms < 0) ? -ms : ms) % 1000 / 100);
    print_setpoints(self);
    print_telemetry(self);
    (void)puts("\nWhat it tells (+ speaks for, - speaks against, ? says nothing about)");
    learn_weigh(self, &findings);
    for (unsigned i = 0; i < findings.count; i++) {
        (void)printf("  %c %s\n", findings.at[i].mark, findings.at[i].text);
    }
    suggest(&findings);
}
