// SPDX-License-Identifier: MIT
// Both wheels: commanded and measured speed as bars on one scale, and other values as numbers. Below them bus, send
// gaps, assumptions, stop budget, warnings.
#include "text/ctl_text.h"
#include "top.h"

#include "iwheel_northbound/text.h"

#include <curses.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LABEL_COLUMNS 13
#define VALUE_COLUMNS 14
#define BAR_MIN       9
#define BUCKETS_MAX   16U

static const json_t *get(const json_t *object, const char *field) {
    return json_object_get(object, field);
}

int top_scale(int before_mm_s, const json_t *state) {
    static const int steps[] = {200, 500, 1000, 2000, 5000};
    static const char *const fields[] = {"speed_mm_s", "applied_mm_s", "commanded_mm_s"};
    int largest = before_mm_s;
    for (unsigned i = 0; i < 6U; i++) {
        const json_t *value = get(get(state, (i < 3U) ? "left" : "right"), fields[i % 3U]);
        const int speed = json_is_integer(value) ? abs((int)json_integer_value(value)) : 0;
        if (speed > largest) {
            largest = speed;
        }
    }
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        if (largest <= steps[i]) {
            return steps[i];
        }
    }
    return largest;
}

/// Draws a bar from its middle to the value; only the middle if the value is unknown.
static void draw_bar(const top_model_t *model, int row, top_tone_t tone, const json_t *value) {
    const int width = (COLS - LABEL_COLUMNS - VALUE_COLUMNS - 2) | 1;
    const int half = width / 2;
    const int middle = LABEL_COLUMNS + half;
    const char *full = model->fine_blocks ? "\xE2\x96\x88" : "#";
    const char *empty = model->fine_blocks ? "\xC2\xB7" : ".";
    if (width < BAR_MIN) {
        return;
    }
    const long long speed = json_is_integer(value) ? json_integer_value(value) : 0;
    const long long whole = (llabs(speed) * half + model->scale_mm_s / 2) / model->scale_mm_s;
    const long long length = (whole > half) ? half : whole;
    for (int i = 1; i <= half; i++) {
        const bool left = speed < 0 && i <= length;
        const bool right = speed > 0 && i <= length;
        top_put(model, row, middle - i, left ? tone : TOP_FAINT, "%s", left ? full : empty);
        top_put(model, row, middle + i, right ? tone : TOP_FAINT, "%s", right ? full : empty);
    }
    top_put(model, row, middle, TOP_PLAIN, "%s", model->fine_blocks ? "\xE2\x94\x82" : "|");
}

static void draw_speed(const top_model_t *model, int row, const char *label, top_tone_t tone, const json_t *value) {
    char number[TEXT_CELL];
    text_integer(value, "mm/s", number);
    top_put(model, row, 1, TOP_TITLE, "%s", label);
    draw_bar(model, row, tone, value);
    const int column = COLS - VALUE_COLUMNS;
    top_put(model, row, (column > LABEL_COLUMNS) ? column : LABEL_COLUMNS, TOP_TITLE, "%13s", number);
}

/// Writes an integer with fewer decimals than it has: text that is read from a distance needs no thousandths.
static void coarse(const json_t *value, int divisor, unsigned digits, const char *unit, char out[TEXT_CELL]) {
    if (json_is_integer(value)) {
        text_number(json_integer_value(value) / divisor, digits, unit, out);
    } else {
        (void)snprintf(out, TEXT_CELL, "--");
    }
}

/// Draws the numbers of a wheel. Returns the number of rows: two on a narrow terminal.
static int draw_numbers(const top_model_t *model, int row, const json_t *wheel) {
    char force[TEXT_CELL];
    char battery[TEXT_CELL];
    char way[TEXT_CELL];
    char speed_age[TEXT_CELL];
    char force_age[TEXT_CELL];
    const char *validity = text_word(wheel, "force_validity");
    const bool full = json_is_true(get(get(wheel, "saturated"), "battery"));
    coarse(get(wheel, "force_net_mN"), 100, 1, "N", force);
    text_decimal(get(wheel, "battery_dV"), 1, "V", battery);
    coarse(get(wheel, "distance_mm"), 10, 2, "m", way);
    text_integer(get(wheel, "speed_age_ms"), "", speed_age);
    text_integer(get(wheel, "force_age_ms"), "ms", force_age);
    const bool valid = strcmp(validity, "valid") == 0;
    const top_tone_t tone = valid ? TOP_PLAIN : TOP_CARE;
    char first[2U * TEXT_CELL];
    (void)snprintf(first, sizeof first, "force %s%s%.20s", force, valid ? "" : " ", valid ? "" : validity);
    if (COLS >= TOP_COLUMNS_WHOLE) {
        top_put(model, row, LABEL_COLUMNS, tone, "%s, %s%s, %s, age %s/%s", first, full ? ">= " : "", battery, way,
                speed_age, force_age);
        return 1;
    }
    top_put(model, row, 1, tone, "%s, %s%s", first, full ? ">= " : "", battery);
    top_put(model, row + 1, 1, tone, "%s, age %s/%s", way, speed_age, force_age);
    return 2;
}

static int draw_wheel(const top_model_t *model, int row, const char *name, bool brief) {
    const json_t *wheel = get(model->state, (name[0] == 'L') ? "left" : "right");
    const bool online = json_is_true(get(wheel, "heard"));
    char label[24];
    char does[24];
    (void)snprintf(label, sizeof label, "%-6s appl", name);
    (void)snprintf(does, sizeof does, "%-6s %s", "", online ? "meas" : "LOST");
    draw_speed(model, row, label, TOP_CARE, get(wheel, "applied_mm_s"));
    draw_speed(model, row + 1, does, online ? TOP_GOOD : TOP_BAD, get(wheel, "speed_mm_s"));
    return brief ? 2 : 2 + draw_numbers(model, row + 2, wheel);
}

int top_draw_wheels(const top_model_t *model, int row, bool brief) {
    int used = draw_wheel(model, row, "LEFT", brief);
    used += draw_wheel(model, row + used, "RIGHT", brief);
    if (!brief && COLS >= TOP_COLUMNS_WHOLE) {
        top_put(model, row + used, LABEL_COLUMNS, TOP_FAINT, "-%d%*s", model->scale_mm_s,
                ((COLS - LABEL_COLUMNS - VALUE_COLUMNS - 2) | 1) - ((model->scale_mm_s >= 1000) ? 5 : 4) - 5, "");
        top_put(model, row + used, COLS - VALUE_COLUMNS - 6, TOP_FAINT, "%+5d mm/s", model->scale_mm_s);
        used++;
    }
    return used;
}

static bool is_narrow(void) {
    return COLS < TOP_COLUMNS_WHOLE;
}

static void draw_bus(const top_model_t *model, int row) {
    char load[TEXT_CELL];
    const json_t *bus = get(model->state, "bus");
    const char *state = text_word(bus, "state");
    text_decimal(get(bus, "load_permille"), 1, "%", load);
    const top_tone_t tone = (strcmp(state, "active") == 0) ? TOP_PLAIN : TOP_BAD;
    if (is_narrow()) {
        top_put(model, row, 1, tone, "BUS     %s, load %s", state, load);
    } else {
        top_put(model, row, 1, tone, "BUS     %s, load %s, timing %s, echo %s", state, load, text_word(bus, "timing"),
                text_word(bus, "echo"));
    }
}

/// Returns a share of the largest bucket as a block of eight heights, or as a character in a terminal without blocks.
static const char *height(const top_model_t *model, long long count, long long largest) {
    static const char *const blocks[] = {" ",
                                         "\xE2\x96\x81",
                                         "\xE2\x96\x82",
                                         "\xE2\x96\x83",
                                         "\xE2\x96\x84",
                                         "\xE2\x96\x85",
                                         "\xE2\x96\x86",
                                         "\xE2\x96\x87",
                                         "\xE2\x96\x88"};
    static const char *const signs[] = {" ", ".", ".", ":", ":", "|", "|", "#", "#"};
    const long long eighths = (largest > 0 && count > 0) ? (count * 8 + largest - 1) / largest : 0;
    return model->fine_blocks ? blocks[eighths] : signs[eighths];
}

/// Draws "GAPS  5 10 15 >20 ms" with a height over each.
static void draw_gaps(const top_model_t *model, int row) {
    const json_t *gaps = get(model->state, "gaps");
    const json_t *counts = get(gaps, "count");
    const json_t *limits = get(gaps, "limits_ms");
    char worst[TEXT_CELL];
    const json_t *entry = NULL;
    size_t i = 0;
    long long largest = 0;
    int column = 9;
    const json_t *worst_us = get(gaps, "worst_us");
    if (json_is_integer(worst_us)) {
        text_number((json_integer_value(worst_us) + 99) / 100, 1, "ms", worst); // Rounded up.
    } else {
        (void)snprintf(worst, sizeof worst, "--");
    }
    json_array_foreach(counts, i, entry) {
        if (json_integer_value(entry) > largest) {
            largest = json_integer_value(entry);
        }
    }
    top_put(model, row, 1, TOP_PLAIN, "GAPS");
    json_array_foreach(counts, i, entry) {
        const bool last = i >= json_array_size(limits);
        const long long limit = json_integer_value(json_array_get(limits, last ? i - 1U : i));
        const char *block = height(model, json_integer_value(entry), largest);
        const bool bad = last && json_integer_value(entry) > 0;
        if (i >= BUCKETS_MAX) {
            break;
        }
        if (is_narrow()) {
            top_put(model, row, column++, bad ? TOP_BAD : TOP_TITLE, "%s", block);
            continue;
        }
        top_put(model, row, column, bad ? TOP_BAD : TOP_TITLE, "%s%s%s", block, block, block);
        top_put(model, row + 1, column, TOP_FAINT, "%s%lld", last ? ">" : "", limit);
        column += (limit >= 100 || last) ? 5 : 4;
    }
    top_put(model, row, column + 1, TOP_PLAIN, "worst %s", worst);
    if (!is_narrow()) {
        top_put(model, row + 1, column + 1, TOP_FAINT, "ms between setpoints");
    }
}

static void draw_assumptions(const top_model_t *model, int row) {
    static const char *const states[] = {"confirmed", "assumed", "contradicted"};
    unsigned total[3] = {0, 0, 0};
    char names[TOP_TEXT_SIZE];
    iwn_text_t list = iwn_text_begin(names, sizeof names);
    const char *name = NULL;
    json_t *entry = NULL;
    json_object_foreach(json_object_get(model->state, "ledger"), name, entry) {
        const char *state = text_word(entry, "state");
        for (unsigned i = 0; i < 3U; i++) {
            total[i] += (strcmp(state, states[i]) == 0) ? 1U : 0U;
        }
        if (strcmp(state, states[2]) == 0) {
            IWN_TEXT_JOIN(&list, " ", name);
        }
    }
    const top_tone_t tone = (total[2] > 0) ? TOP_BAD : TOP_PLAIN;
    if (is_narrow() && total[2] > 0) {
        top_put(model, row, 1, tone, "LEDGER  %u CONTRADICTED:%s", total[2], names);
    } else if (is_narrow()) {
        top_put(model, row, 1, tone, "LEDGER  %u confirmed, %u assumed", total[0], total[1]);
    } else {
        top_put(model, row, 1, tone, "LEDGER  %u confirmed, %u assumed, %u contradicted%s%s", total[0], total[1],
                total[2], (total[2] > 0) ? ":" : "", names);
    }
}

static void draw_budget(const top_model_t *model, int row) {
    char time[TEXT_CELL];
    char way[TEXT_CELL];
    const json_t *budget = get(model->state, "budget");
    text_integer(get(budget, "client_lost_ms"), "ms", time);
    text_decimal(get(budget, "client_lost_mm"), 3, "m", way);
    top_put(model, row, 1, TOP_PLAIN,
            is_narrow() ? "STOP    at most %s and %s" : "STOP    at most %s and %s after the client's last command",
            time, way);
}

/// Draws the warnings. Returns the number of rows; more than one only on a narrow terminal.
static int draw_warnings(const top_model_t *model, int row, int rows) {
    char text[TOP_TEXT_SIZE];
    const json_t *warnings = get(model->state, "warnings");
    const size_t count = json_array_size(warnings);
    const char *first = json_string_value(json_array_get(warnings, 0));
    if (count == 0 || rows < 1) {
        return 0;
    }
    (void)snprintf(text, sizeof text, "%zu warning%s: %s", count, (count > 1) ? "s" : "",
                   (first != NULL) ? first : "--");
    if (!is_narrow()) {
        top_put(model, row, 1, TOP_CARE, "%s", text);
        return 1;
    }
    return top_put_wrapped(model, row, (rows > 4) ? 4 : rows, TOP_CARE, text);
}

int top_draw_rest(const top_model_t *model, int row, int rows) {
    // The most important part comes first; a part without a row is left out.
    const struct {
        void (*draw)(const top_model_t *, int);
        int rows;
    } parts[] = {{draw_bus, 1}, {draw_assumptions, 1}, {draw_gaps, is_narrow() ? 1 : 2}, {draw_budget, 1}};
    int used = 0;
    for (size_t i = 0; i < sizeof parts / sizeof parts[0] && rows - used >= parts[i].rows; i++) {
        parts[i].draw(model, row + used);
        used += parts[i].rows;
    }
    return used + draw_warnings(model, row + used, rows - used);
}
