// SPDX-License-Identifier: MIT
#include "learn_drives.h"
#include "recordings/ctl_recording.h"
#include "talk/ctl.h"
#include "text/ctl_text.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

#define CELL     26
#define EXTENDED "extended; the wheels use a standard id (python-can: is_extended_id=False)"

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

static void print_setpoints(const learn_t *self) {
    static const char *const labels[] = {"frames", "type", "speed", "current", "length", "period"};
    char text[sizeof labels / sizeof labels[0]][IW_SIDES][LEARN_TEXT];
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const learn_setpoint_t *each = &self->setpoint[side];
        (void)snprintf(text[0][side], LEARN_TEXT, "%" PRIu64, each->count);
        types_text(each, text[1][side]);
        range_text(&each->speed_mm_s, " mm/s", text[2][side]);
        range_text(&each->current_mA, " mA", text[3][side]);
        range_text(&self->known[side].length, " bytes", text[4][side]);
        period_text(&self->known[side].period, text[5][side]);
    }
    (void)printf("\nSetpoints    left 266 (0x10A)%*sright 298 (0x12A)\n", CELL - 15, "");
    for (size_t i = 0; i < sizeof labels / sizeof labels[0]; i++) {
        (void)printf("  %-10s %-*s %s\n", labels[i], CELL, text[i][IW_LEFT], text[i][IW_RIGHT]);
    }
}

static void print_id(const learn_id_t *id, const char *said) {
    char length[LEARN_TEXT];
    char period[LEARN_TEXT];
    range_text(&id->length, " bytes", length);
    period_text(&id->period, period);
    (void)printf("  %4" PRIu32 " (0x%0*" PRIX32 ")  %8" PRIu64 "  %-18s %-26s %s\n", id->id, id->extended ? 8 : 3,
                 id->id, id->count, length, period, said);
}

/// Returns true for an extended id with the number of a standard id of the wheels.
static bool is_extended_of_ours(const learn_t *self, const learn_id_t *id) {
    return id->extended && learn_known(self, id->id) != NULL;
}

static void print_telemetry(const learn_t *self) {
    static const char *const documented[LEARN_IDS] = {
        [2] = "document: 4 bytes, 4 ms",
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
        print_id(&self->other[i], is_extended_of_ours(self, &self->other[i]) ? EXTENDED : "");
    }
    if (self->more_others > 0U) {
        (void)printf("  and %" PRIu64 " frames of more ids\n", self->more_others);
    }
}

static void print_drives(const learn_drives_t *self, int64_t first_us) {
    if (self->count > 0U) {
        (void)puts("\nDrives    begins at    lasts  leaves its path by up to");
    }
    for (uint32_t i = 0; i < learn_drives_printed(self); i++) {
        const learn_drive_t *each = &self->drive[i];
        (void)printf("  %4" PRIu32 "  %9.1f s  %5.1f s  ", i + 1U, (double)(each->begin_us - first_us) / 1e6,
                     (double)(each->end_us - each->begin_us) / 1e6);
        if (each->judged_us > 0) {
            (void)printf("%" PRIu32 " mm\n", each->deviation_mm);
        } else {
            (void)puts("--");
        }
    }
    if (self->count > LEARN_DRIVES_MAX) {
        (void)printf("  and %" PRIu32 " more\n", self->count - LEARN_DRIVES_MAX);
    }
}

static void suggest(const learn_findings_t *findings) {
    const char *last = "";
    for (unsigned i = 0; i < findings->count; i++) {
        const char *section;
        const char *key;
        if (learn_suggests(findings, &findings->at[i], &section, &key)) {
            if (last[0] == '\0') {
                (void)puts("\nSuggestions for the configuration (observed, not proven; then: iwheelctl bringup)\n");
            }
            if (strcmp(section, last) != 0) {
                (void)printf("[%s]\n", section);
            }
            (void)printf("%s = %s\n", key, findings->at[i].value);
            last = section;
        }
    }
}

/// The data of a recording, and the findings about it.
typedef struct {
    learn_t learn;
    learn_drives_t drives;
    learn_findings_t findings;
    iw_config_t config;
} study_t;

/// Prints the whole report.
static void report(const study_t *study, const char *name) {
    const learn_t *self = &study->learn;
    const learn_findings_t *findings = &study->findings;
    const int64_t ms = (self->last_us - self->first_us) / 1000;
    text_line(stdout, "%s: %" PRIu64 " frames in %" PRId64 ".%" PRId64 " s", name, self->frames, ms / 1000,
              ((ms < 0) ? -ms : ms) % 1000 / 100);
    print_setpoints(self);
    print_telemetry(self);
    print_drives(&study->drives, self->first_us);
    (void)puts("\nFindings (+ for, - against, ? not known)");
    for (unsigned i = 0; i < findings->count; i++) {
        (void)printf("  %c %s\n", findings->at[i].mark, findings->at[i].text);
    }
    suggest(findings);
}

// The report for programs: counts, findings and suggestions.
#include "text/ctl_text.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

/// Returns [low, high], or null for an empty range.
static json_t *range(const learn_range_t *range) {
    return learn_is_empty(range) ? json_null() : json_pack("[i,i]", (int)range->low, (int)range->high);
}

static json_t *number(uint64_t value) {
    return json_integer((json_int_t)value);
}

static json_t *types(const uint64_t count[256]) {
    json_t *object = json_object();
    for (unsigned type = 0; type < 256U; type++) {
        char name[8];
        (void)snprintf(name, sizeof name, "%u", type);
        if (count[type] > 0U) {
            (void)json_object_set_new(object, name, number(count[type]));
        }
    }
    return object;
}

static json_t *id(const learn_id_t *id) {
    const bool timed = id->period.counted >= 2U;
    return json_pack("{s:I,s:b,s:o,s:o,s:o,s:o}", "id", (json_int_t)id->id, "extended", (int)id->extended, "frames",
                     number(id->count), "length", range(&id->length), "period_ms",
                     timed ? json_integer((json_int_t)learn_period_ms(&id->period)) : json_null(), "longest_us",
                     timed ? json_integer((json_int_t)id->period.longest_us) : json_null());
}

static json_t *setpoints(const learn_t *self, unsigned side) {
    const learn_setpoint_t *each = &self->setpoint[side];
    json_t *object = id(&self->known[side]);
    json_t *more =
        json_pack("{s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o}", "sent", number(each->sent), "types",
                  types(each->type), "types_moving", types(each->type_moving), "at_rest", number(each->at_rest),
                  "forward", number(each->forward), "backward", number(each->backward), "changes_of_type",
                  number(each->changes_of_type), "over_limit", number(each->over_limit), "padding",
                  number(each->padding), "speed_mm_s", range(&each->speed_mm_s), "current_mA", range(&each->current_mA),
                  "current_at_rest_mA", range(&each->current_at_rest_mA), "current_forward_mA",
                  range(&each->current_forward_mA), "current_backward_mA", range(&each->current_backward_mA));
    (void)json_object_update(object, more);
    json_decref(more);
    return object;
}

static json_t *answer(const learn_answer_t *answer) {
    return json_pack("{s:o,s:o,s:o}", "with_ms", json_integer(answer->with_us / 1000), "against_ms",
                     json_integer(answer->against_us / 1000), "still_ms", json_integer(answer->still_us / 1000));
}

static json_t *wheel(const learn_wheel_t *each) {
    const json_int_t um_s = (each->steady_rpm > 0) ? each->steady_mm_s * 1000 / each->steady_rpm : 0;
    return json_pack("{s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o}", "speed_frames", number(each->speeds),
                     "told_forward", answer(&each->forward), "told_backward", answer(&each->backward),
                     "stood_at_zero_ms", json_integer(each->stood_us / 1000), "ran_at_zero_ms",
                     json_integer(each->ran_us / 1000), "status_frames", number(each->statuses), "um_s_per_rpm",
                     (um_s > 0) ? json_integer(um_s) : json_null(), "ticks", number(each->ticks), "milli_turns",
                     json_integer(each->turned_rpm_us / 60000), "force_frames", number(each->forces), "force_raw",
                     range(&each->force), "force_raw_at_rest", range(&each->rest_force), "offset_dN",
                     range(&each->offset_dN));
}

static json_t *findings_of(const learn_findings_t *self, json_t *suggested) {
    json_t *list = json_array();
    for (unsigned i = 0; i < self->count; i++) {
        const learn_finding_t *each = &self->at[i];
        const char *section;
        const char *key;
        (void)json_array_append_new(
            list, json_pack("{s:s,s:s?,s:s,s:s?,s:s}", "item", each->item, "side",
                            (each->side == LEARN_BOTH) ? NULL : text_side(each->side), "verdict",
                            (each->mark == '+')   ? "for"
                            : (each->mark == '-') ? "against"
                                                  : "unknown",
                            "value", (each->value[0] != '\0') ? each->value : NULL, "text", each->text));
        if (learn_suggests(self, each, &section, &key)) {
            json_t *lines = json_object_get(suggested, section);
            if (lines == NULL) {
                lines = json_object();
                (void)json_object_set_new(suggested, section, lines);
            }
            (void)json_object_set_new(lines, key, json_string(each->value));
        }
    }
    return list;
}

static json_t *ids(const learn_id_t *from, unsigned count) {
    json_t *list = json_array();
    for (unsigned i = 0; i < count; i++) {
        (void)json_array_append_new(list, id(&from[i]));
    }
    return list;
}

static json_t *drives_of(const learn_drives_t *self) {
    json_t *list = json_array();
    for (uint32_t i = 0; i < learn_drives_printed(self); i++) {
        const learn_drive_t *each = &self->drive[i];
        (void)json_array_append_new(list, json_pack("{s:I,s:I,s:o}", "begin_us", (json_int_t)each->begin_us, "end_us",
                                                    (json_int_t)each->end_us, "deviation_mm",
                                                    (each->judged_us > 0) ? number(each->deviation_mm) : json_null()));
    }
    return list;
}

/// Prints the report for programs, as one JSON object in one line: counts, findings, suggestions. Returns false if
/// there is no memory for it.
static bool report_json(const study_t *study, const char *name) {
    const learn_t *self = &study->learn;
    json_t *suggested = json_object();
    json_t *root =
        json_pack("{s:s,s:o,s:I,s:{s:o,s:o},s:{s:o,s:o},s:o,s:o,s:o,s:o,s:I,s:o,s:o}", "file", name, "frames",
                  number(self->frames), "duration_us", (json_int_t)(self->last_us - self->first_us), "setpoints",
                  "left", setpoints(self, IW_LEFT), "right", setpoints(self, IW_RIGHT), "wheels", "left",
                  wheel(&self->wheel[IW_LEFT]), "right", wheel(&self->wheel[IW_RIGHT]), "telemetry",
                  ids(&self->known[IW_SIDES], LEARN_IDS - IW_SIDES), "other_ids", ids(self->other, self->others),
                  "more_others", number(self->more_others), "drives", drives_of(&study->drives), "more_drives",
                  (json_int_t)(study->drives.count - learn_drives_printed(&study->drives)), "findings",
                  findings_of(&study->findings, suggested), "suggested", suggested);
    if (root == NULL) {
        return false;
    }
    (void)json_dumpf(root, stdout, JSON_COMPACT);
    (void)putchar('\n');
    json_decref(root);
    return true;
}

static int read_all(study_t *study, recording_t *recording) {
    candump_t frame;
    learn_init(&study->learn);
    learn_drives_init(&study->drives, &study->config);
    while (recording_next(recording, &frame)) {
        learn_frame(&study->learn, &frame);
        learn_drives_frame(&study->drives, &frame);
    }
    if (recording->refused) {
        return recording_close(recording);
    }
    learn_weigh(&study->learn, &study->findings);
    learn_drives_weigh(&study->drives, &study->findings);
    return CTL_OK;
}

int verb_learn(ctl_t *self, int count, char **words) {
    static study_t study;
    static recording_t recording;
    const learn_t *learn = &study.learn;
    const char *path = NULL;
    const option_t options[] = {{OPTION("--interface", option_text, &recording.only)},
                                {OPTION("--config", config_option_load, &study.config)},
                                {.name = NULL}};
    const words_syntax_t syntax = {"learn", options, words_is_file, &path};
    iw_config_default(&study.config);
    int code = words_read(&syntax, count, words);
    if (code == CTL_OK && path == NULL) {
        code = ctl_fail(CTL_USAGE, "learn needs one recording (or -); see: iwheelctl learn --help");
    }
    recording.even = true;
    if (code == CTL_OK) {
        code = recording_open(&recording, NULL, path);
    }
    if (code == CTL_OK) {
        code = read_all(&study, &recording);
    }
    if (code != CTL_OK || recording.refused) {
        return code;
    }
    const bool commanded = learn->setpoint[IW_LEFT].count + learn->setpoint[IW_RIGHT].count > 0U;
    if (self->json && !report_json(&study, recording.name)) {
        (void)recording_close(&recording);
        return ctl_fail(CTL_INTERNAL, "out of memory");
    }
    if (!self->json && learn->frames > 0U) {
        report(&study, recording.name);
    }
    code = recording_close(&recording);
    return (code != CTL_OK || commanded) ? code : CTL_NO;
}
