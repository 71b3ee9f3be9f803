// SPDX-License-Identifier: MIT
// The reply to `status` as text: at most 80 columns, each number with its unit, `--` for unknown values.
#include "advice.h"
#include "talk/ctl.h"
#include "talk/ctl_words.h"
#include "text/ctl_text.h"

#include "iwheel_northbound/text.h"

#include <stdio.h>
#include <string.h>

static bool is(const char *word, const char *other) {
    return strcmp(word, other) == 0;
}

static const json_t *get(const json_t *object, const char *field) {
    return json_object_get(object, field);
}

static tone_t state_tone(const char *state) {
    if (is(state, "latched")) {
        return TONE_BAD;
    }
    return is(state, "listening") ? TONE_PLAIN : TONE_CARE;
}

static void draw_state(const paper_t *paper, const json_t *status, const json_t *why) {
    const char *state = text_word(status, "state");
    const json_t *sentence = get(why, "sentence");
    advice_t advice;
    advice_collect(status, &advice);
    paper_label(paper, "STATE");
    paper_print(paper, state_tone(state), "%.32s", json_is_true(get(status, "arming")) ? "arming" : state);
    if (json_is_string(get(status, "cause"))) {
        paper_print(paper, state_tone(state), " (%.32s)", text_word(status, "cause"));
    }
    if (json_is_true(get(status, "holding"))) {
        paper_print(paper, TONE_CARE, ", holding");
    }
    if (json_is_true(get(status, "rolling"))) {
        paper_print(paper, TONE_BAD, ", rolling");
    }
    paper_end(paper);
    for (unsigned i = 0; i < advice.lines; i++) {
        paper_wrap(paper, (i == 0) ? "next" : "", TONE_TITLE, advice.line[i]);
    }
    if (json_is_string(sentence) && json_string_length(sentence) > 0) {
        paper_wrap(paper, "last stop", TONE_PLAIN, json_string_value(sentence));
    }
}

static void draw_lease(const paper_t *paper, const json_t *lease) {
    char text[512];
    char client[TEXT_CELL];
    char pid[TEXT_CELL];
    char left[TEXT_CELL];
    char whole[TEXT_CELL];
    const bool held = json_is_integer(get(lease, "holder"));
    text_integer(get(lease, "holder"), "", client);
    text_integer(get(lease, "pid"), "", pid);
    text_integer(get(lease, "remaining_ms"), "ms", left);
    text_integer(get(lease, "lease_ms"), "ms", whole);
    if (held) {
        (void)snprintf(text, sizeof text, "%.128s (client %s, pid %s), %s left; a command is valid for %s",
                       text_word(lease, "name"), client, pid, left, whole);
    } else {
        (void)snprintf(text, sizeof text, "no client drives; a command is valid for %s", whole);
    }
    paper_wrap(paper, "LEASE", held ? TONE_CARE : TONE_PLAIN, text);
}

/// Returns the time when a real button was last tested; "" if the gateway does not report it.
static const char *report_tried(const json_t *estop, char *out_text, size_t size) {
    const json_t *tried = json_object_get(estop, "tried_wall_us");
    char when[TEXT_CELL] = "never";
    if (json_is_integer(tried)) {
        text_when(json_integer_value(tried), when);
    }
    (void)snprintf(out_text, size, "; button tried: %s", when);
    return (tried == NULL) ? "" : out_text;
}

/// Returns the second line of the e-stop, and which contact is pressed; "" with one contact.
static const char *report_second(const json_t *estop, char *out_text, size_t size) {
    const char *line2 = json_string_value(get(estop, "line2"));
    const char *where = text_word(estop, "pressed_at");
    (void)snprintf(out_text, size, ", line2 %.128s%s%.16s", (line2 != NULL) ? line2 : "",
                   is(where, "neither") ? "" : "; pressed at ", is(where, "neither") ? "" : where);
    return (line2 == NULL) ? "" : out_text;
}

static void draw_surroundings(const paper_t *paper, const json_t *status) {
    char text[512];
    char tried[TEXT_CELL + 32U];
    char second[192];
    const json_t *bus = get(status, "bus");
    const json_t *estop = get(status, "estop");
    const char *button = text_word(estop, "state");
    (void)snprintf(text, sizeof text, "%.128s %.32s, timing %.32s, echo %.32s", text_word(bus, "name"),
                   text_word(bus, "state"), text_word(bus, "timing"), text_word(bus, "echo"));
    paper_wrap(paper, "BUS", is(text_word(bus, "state"), "active") ? TONE_GOOD : TONE_BAD, text);
    const bool simulated = json_is_true(get(estop, "simulated"));
    (void)snprintf(text, sizeof text, "%.32s%s, line %.128s%s%s", is(button, "none") ? "NONE" : button,
                   simulated ? " (SIMULATED)" : "", text_word(estop, "line"),
                   report_second(estop, second, sizeof second),
                   (simulated || is(button, "none")) ? "" : report_tried(estop, tried, sizeof tried));
    paper_wrap(paper, "E-STOP", is(button, "released") ? TONE_GOOD : TONE_BAD, text);
}

/// Value of `digits` for an age.
#define AGE 99U

typedef struct {
    const char *field; ///< NULL if there is no value.
    const char *unit;
    unsigned digits;
} value_t;

/// A line with the values of both wheels next to each other.
typedef struct {
    const char *label;
    value_t values[2];
    const char *remark; ///< Field with a word that explains the values, or NULL.
} row_t;

static const row_t rows[] = {
    {"measured", {{"speed_mm_s", "mm/s", 0}, {"speed_rpm", "rpm", 0}}, NULL},
    {"commanded", {{"commanded_mm_s", "mm/s", 0}, {"commanded_mA", "mA", 0}}, NULL},
    {"applied", {{"applied_mm_s", "mm/s", 0}, {"applied_mA", "mA", 0}}, NULL},
    {"speed age", {{"speed_age_ms", "ms", 0}}, NULL},
    {"distance", {{"distance_mm", "m", 3}, {"ticks", "ticks", 0}}, NULL},
    {"net force", {{"force_net_mN", "N", 3}}, "force_validity"},
    {"raw force", {{"force_raw_mN", "N", 3}, {"force_age_ms", "ms ago", 0}}, NULL},
    {"force offset", {{"force_offset_mN", "N", 3}}, "offset_provenance"},
    {"offset age", {{"offset_age_ms", "ago", AGE}, {"offset_deviation_mN", "N noise", 3}}, NULL},
    {"unit observed", {{NULL, NULL, 0}}, "unit_evidence"},
    {"battery", {{"battery_dV", "V", 1}, {"status_age_ms", "ms ago", 0}}, NULL},
    {"controller", {{"temperature_degC", "degC", 0}, {"cpu_percent", "% CPU", 0}}, NULL},
    {"reboots", {{"reboots", "seen", 0}}, NULL},
};

/// Returns true if the byte of the battery voltage is full: the voltage is at least this value.
static bool is_lower_bound(const value_t *value, const json_t *wheel) {
    return is(value->field, "battery_dV") && json_is_true(get(get(wheel, "saturated"), "battery"));
}

static void write_value(const value_t *value, const json_t *wheel, char number[TEXT_CELL]) {
    char age[TEXT_CELL];
    if (value->digits != AGE) {
        text_decimal(get(wheel, value->field), value->digits, value->unit, number);
        return;
    }
    text_age(get(wheel, value->field), age);
    (void)snprintf(number, TEXT_CELL, "%.32s%s%s", age, is(age, "--") ? "" : " ", is(age, "--") ? "" : value->unit);
}

/// Writes the word that explains the values. The remark of an offset also contains the origin of a stored offset, and
/// whether the offset was measured under load.
static void write_remark(const row_t *row, const json_t *wheel, char remark[TEXT_CELL]) {
    const char *word = (row->remark != NULL) ? text_word(wheel, row->remark) : "";
    const bool zero = row->remark != NULL && is(row->remark, "offset_provenance");
    const bool stored = zero && is(word, "stored") && json_is_string(get(wheel, "offset_origin"));
    const bool spoilt = zero && json_is_true(get(wheel, "offset_contaminated"));
    (void)snprintf(remark, TEXT_CELL, "%.16s%s%.16s%s%s", is(word, "valid") ? "" : word, stored ? " (" : "",
                   stored ? text_word(wheel, "offset_origin") : "", stored ? ")" : "", spoilt ? " IN DOUBT" : "");
}

static void draw_cell(const paper_t *paper, const row_t *row, unsigned width, const json_t *wheel) {
    char cell[PAPER_CELL] = "";
    char number[TEXT_CELL];
    char remark[TEXT_CELL];
    size_t used = 0;
    bool known = row->values[0].field == NULL;
    for (size_t i = 0; i < 2 && row->values[i].field != NULL; i++) {
        const value_t *value = &row->values[i];
        write_value(value, wheel, number);
        known = known || !is(number, "--");
        const int n = snprintf(cell + used, sizeof cell - used, "%s%s%s", (used > 0) ? ", " : "",
                               is_lower_bound(value, wheel) ? ">= " : "", number);
        used += (n > 0 && (size_t)n < sizeof cell - used) ? (size_t)n : 0U;
    }
    write_remark(row, wheel, remark);
    (void)snprintf(cell + used, sizeof cell - used, "%s%s", (used > 0 && remark[0] != '\0') ? " " : "", remark);
    paper_text(paper, known ? TONE_PLAIN : TONE_FAINT, width, cell);
}

static void draw_head(const paper_t *paper, const char *name, unsigned width, const json_t *wheel) {
    const json_t *online = get(wheel, "heard");
    const char *rest = json_is_true(get(wheel, "at_rest")) ? "standstill" : "turning";
    char head[TEXT_CELL];
    (void)snprintf(head, sizeof head, "%s %s", name, json_is_true(online) ? rest : "OFFLINE");
    paper_text(paper, json_is_true(online) ? TONE_TITLE : TONE_BAD, width, head);
}

static void draw_wheels(const paper_t *paper, const json_t *left, const json_t *right) {
    paper_label(paper, "WHEELS");
    draw_head(paper, "LEFT", PAPER_CELL, left);
    draw_head(paper, "RIGHT", 0, right);
    paper_end(paper);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        paper_label(paper, rows[i].label);
        draw_cell(paper, &rows[i], PAPER_CELL, left);
        draw_cell(paper, &rows[i], 0, right);
        paper_end(paper);
    }
}

static void draw_pose(const paper_t *paper, const json_t *pose) {
    static const char *const fields[] = {"x_mm", "y_mm", "z_mm", "psi_mrad"};
    static const char *const names[] = {"x", "y", "z", "psi"};
    char number[TEXT_CELL];
    paper_label(paper, "POSE");
    for (size_t i = 0; i < 4; i++) {
        text_integer(get(pose, fields[i]), (i < 3) ? "mm" : "mrad", number);
        paper_print(paper, TONE_PLAIN, "%s%s %s", (i > 0) ? ", " : "", names[i], number);
    }
    paper_print(paper, TONE_CARE, "%s", json_is_true(get(pose, "limited")) ? ", AT THE END OF ITS RANGE" : "");
    paper_end(paper);
}

/// Prints the names of the items in one state as one line; nothing if there are none.
static void draw_assumptions(const paper_t *paper, json_t *assumptions, const char *state, tone_t tone) {
    char text[1024];
    iwn_text_t names = iwn_text_begin(text, sizeof text);
    const char *name = NULL;
    json_t *entry = NULL;
    json_object_foreach(assumptions, name, entry) {
        if (is(text_word(entry, "state"), state)) {
            IWN_TEXT_JOIN(&names, (names.length > 0U) ? ", " : "", name);
        }
    }
    if (names.length > 0U) {
        paper_wrap(paper, is(state, "assumed") ? "UNVERIFIED" : "CONFIRMED", tone, text);
    }
}

/// Prints each contradiction with its reason and its effect.
static void draw_contradictions(const paper_t *paper, json_t *assumptions) {
    char text[640];
    const char *label = "CONTRADICTED";
    const char *name = NULL;
    json_t *entry = NULL;
    json_object_foreach(assumptions, name, entry) {
        if (is(text_word(entry, "state"), "contradicted")) {
            (void)snprintf(text, sizeof text, "%.64s = %.64s: %.240s; disabled: %.240s", name,
                           text_word(entry, "value"), text_word(entry, "reason"), text_word(entry, "disabled"));
            paper_wrap(paper, label, TONE_BAD, text);
            label = "";
        }
    }
}

/// Prints nothing while the learned values are stored.
static void draw_store(const paper_t *paper, const json_t *store) {
    char text[512];
    const char *state = text_word(store, "state");
    if (is(state, "ignored") || is(state, "failed")) {
        (void)snprintf(text, sizeof text, "%.256s: %.160s", text_word(store, "file"), text_word(store, "reason"));
        paper_wrap(paper, is(state, "failed") ? "NOT STORED" : "NOT TRUSTED", TONE_CARE, text);
    }
}

static void draw_budget(const paper_t *paper, const json_t *budget) {
    static const char *const cases[][3] = {
        {"client lost", "client_lost_ms", "client_lost_mm"},
        {"gateway killed", "killed_ms", "killed_mm"},
    };
    char time[TEXT_CELL];
    char way[TEXT_CELL];
    for (size_t i = 0; i < 2; i++) {
        text_integer(get(budget, cases[i][1]), "ms", time);
        text_decimal(get(budget, cases[i][2]), 3, "m", way);
        paper_label(paper, (i == 0) ? "STOP BUDGET" : "");
        paper_print(paper, TONE_PLAIN, "%s: at most %s, %s%s", cases[i][0], time, way,
                    (i == 0) ? "" : ", then unknown");
        paper_end(paper);
    }
}

/// Prints how close the present or the last drive came to a stop. An older gateway does not report it.
static void draw_pair(const paper_t *paper, const json_t *pair) {
    char largest[TEXT_CELL];
    char limit[TEXT_CELL];
    if (json_is_object(pair)) {
        text_integer(get(pair, "largest_mm"), "mm", largest);
        text_integer(get(pair, "limit_mm"), "mm", limit);
        paper_label(paper, "PAIR");
        paper_print(paper, TONE_PLAIN, "largest deviation of the last drive: %s; stop at %s", largest, limit);
        paper_end(paper);
    }
}

static void draw_warnings(const paper_t *paper, const json_t *warnings) {
    size_t index = 0;
    const json_t *warning = NULL;
    json_array_foreach(warnings, index, warning) {
        paper_wrap(paper, (index == 0) ? "WARNINGS" : "", TONE_CARE,
                   json_is_string(warning) ? json_string_value(warning) : "--");
    }
}

/// Prints the status. `why` is the reply of why, or NULL. A field that is missing or has another type counts as
/// unknown, so an older or newer gateway causes no error.
static void draw(const json_t *status, const json_t *why) {
    const paper_t paper = {.out = stdout, .colour = text_wants_colour(stdout)};
    draw_state(&paper, status, why);
    draw_lease(&paper, get(status, "lease"));
    draw_surroundings(&paper, status);
    paper_end(&paper);
    draw_wheels(&paper, get(status, "left"), get(status, "right"));
    paper_end(&paper);
    draw_pose(&paper, get(status, "pose"));
    draw_budget(&paper, get(status, "budget"));
    draw_pair(&paper, json_object_get(status, "pair"));
    draw_contradictions(&paper, json_object_get(status, "ledger"));
    draw_assumptions(&paper, json_object_get(status, "ledger"), "confirmed", TONE_GOOD);
    draw_assumptions(&paper, json_object_get(status, "ledger"), "assumed", TONE_PLAIN);
    draw_store(&paper, get(status, "memory"));
    draw_warnings(&paper, get(status, "warnings"));
}

int verb_status(ctl_t *self, int count, char **words) {
    json_t *status = NULL;
    json_t *why = NULL;
    if (!words_at_most("status", count, 0, words)) {
        return CTL_USAGE;
    }
    const int code = ctl_ask(self, json_pack("{s:s}", "cmd", "status"), &status);
    if (code != CTL_OK || self->json) {
        json_decref(status);
        return code;
    }
    ctl_explain_assumptions(json_object_get(status, "ledger"));
    if (ctl_ask(self, json_pack("{s:s}", "cmd", "why"), &why) == CTL_OK) {
        draw(status, why);
    }
    json_decref(status);
    json_decref(why);
    return (why != NULL) ? CTL_OK : CTL_UNAVAILABLE;
}
