// SPDX-License-Identifier: MIT
// Bus, send gaps, ledger, stop budget, warnings.
#include "text/text.h"
#include "top.h"

#include <curses.h>
#include <stdio.h>
#include <string.h>

#define BUCKETS_MAX 16U

static const json_t *get(const json_t *object, const char *field) {
    return json_object_get(object, field);
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

/// A share of the largest bucket as a block of eight heights, or a digit of ten where there are no blocks.
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

/// "GAPS  5 10 15 >20 ms" with a height over each.
static void draw_gaps(const top_model_t *model, int row) {
    const json_t *gaps = get(model->state, "gaps");
    const json_t *counts = get(gaps, "count");
    const json_t *limits = get(gaps, "limits_ms");
    char worst[TEXT_CELL];
    const json_t *entry = NULL;
    size_t i = 0;
    long long largest = 0;
    int column = 9;
    json_t *tenths = json_is_integer(get(gaps, "worst_us"))
                         ? json_integer((json_integer_value(get(gaps, "worst_us")) + 99) / 100)
                         : json_null();
    text_decimal(tenths, 1, "ms", worst);
    json_decref(tenths);
    json_array_foreach(counts, i, entry) {
        largest = (json_integer_value(entry) > largest) ? json_integer_value(entry) : largest;
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

static void draw_ledger(const top_model_t *model, int row) {
    static const char *const states[] = {"confirmed", "assumed", "contradicted"};
    unsigned total[3] = {0, 0, 0};
    char names[TOP_TEXT_SIZE] = "";
    const char *name = NULL;
    json_t *entry = NULL;
    json_object_foreach(json_object_get(model->state, "ledger"), name, entry) {
        const char *state = text_word(entry, "state");
        for (unsigned i = 0; i < 3U; i++) {
            total[i] += (strcmp(state, states[i]) == 0) ? 1U : 0U;
        }
        if (strcmp(state, states[2]) == 0) {
            const size_t used = strlen(names);
            (void)snprintf(&names[used], sizeof names - used, " %s", name);
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

/// How many rows they took; more than one only on a narrow terminal.
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
    // What matters most comes first; what has no row is left out.
    const struct {
        void (*draw)(const top_model_t *, int);
        int rows;
    } parts[] = {{draw_bus, 1}, {draw_ledger, 1}, {draw_gaps, is_narrow() ? 1 : 2}, {draw_budget, 1}};
    int used = 0;
    for (size_t i = 0; i < sizeof parts / sizeof parts[0] && rows - used >= parts[i].rows; i++) {
        parts[i].draw(model, row + used);
        used += parts[i].rows;
    }
    return used + draw_warnings(model, row + used, rows - used);
}
