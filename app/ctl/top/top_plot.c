// SPDX-License-Identifier: MIT
// Speed and force of the last minute, drawn with characters on a terminal that is large enough.
#include "top.h"

#include <curses.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>

#define UNKNOWN INT32_MIN
/// Smallest scales.
#define SPEED_MIN_mm_s 100
#define FORCE_MIN_mN   10000
#define LABEL          8
#define ROWS_MIN       5
#define ROWS_MAX       20
#define COLUMNS_MAX    300
#define COLUMNS_TWO    120 ///< From this width on both wheels are next to each other.
#define BRAILLE_DOWN   4
#define CELL_SIZE      4 ///< Bytes of a character, with terminator.

/// A part of the screen.
typedef struct {
    int row;
    int column;
    int rows;
    int columns;
} place_t;

/// One plot.
typedef struct {
    const int32_t *values;
    int columns;
    int rows;
    int across; ///< Dots across a cell.
    int down;
    int32_t low;
    int32_t high;
} plot_t;

void top_history_take(top_history_t *self, int64_t now_us, const json_t *state) {
    static const char *const fields[] = {"speed_mm_s", "force_net_mN"};
    // In the first minute after the machine has booted, the slots before this one must not be negative.
    const int64_t slot = now_us / TOP_HISTORY_US + TOP_HISTORY;
    if (slot - self->slot > TOP_HISTORY || self->slot == 0) {
        self->slot = slot - TOP_HISTORY;
    }
    for (; self->slot < slot; self->slot++) {
        for (int i = 0; i < TOP_PLOTS; i++) {
            self->value[i][(self->slot + 1) % TOP_HISTORY] = UNKNOWN;
        }
    }
    for (int i = 0; i < TOP_PLOTS && state != NULL; i++) {
        const json_t *wheel = json_object_get(state, (i % 2 == 0) ? "left" : "right");
        const json_t *value = json_object_get(wheel, fields[i / 2]);
        if (json_is_integer(value) && llabs(json_integer_value(value)) < INT32_MAX) {
            self->value[i][slot % TOP_HISTORY] = (int32_t)json_integer_value(value);
        }
    }
}

/// Returns the round number that covers the known values of both wheels, so that they can be compared.
static int32_t limit_of(const int32_t (*pair)[TOP_HISTORY], int32_t least, bool *out_negative) {
    int64_t largest = 0;
    *out_negative = false;
    for (int i = 0; i < 2 * TOP_HISTORY; i++) {
        const int32_t value = pair[i / TOP_HISTORY][i % TOP_HISTORY];
        const int64_t size = (value == UNKNOWN) ? 0 : llabs((long long)value);
        if (size > largest) {
            largest = size;
        }
        *out_negative = *out_negative || (value != UNKNOWN && value < -least / 20);
    }
    int64_t limit = least;
    for (int step = 0; limit < largest; step++) {
        limit = (step % 3 == 1) ? limit * 5 / 2 : limit * 2; // 1 2 5 10 20 50
    }
    return (int32_t)limit;
}

/// Returns the row of dots of a value, from above.
static int dot_row(const plot_t *plot, int32_t value) {
    const int dots = plot->rows * plot->down;
    const int64_t span = (int64_t)plot->high - plot->low;
    const int64_t up = ((int64_t)value - plot->low) * (dots - 1);
    const int row = dots - 1 - (int)((up + span / 2) / span);
    return (row < 0) ? 0 : (row >= dots) ? dots - 1 : row;
}

/// Finds the first and last dot of the values in one column of dots. Returns false if no value is known.
static bool reach(const plot_t *plot, int64_t slot, int x, int *out_top, int *out_bottom) {
    const int dots = plot->columns * plot->across;
    const int first = (int)((int64_t)x * TOP_HISTORY / dots);
    const int last = (int)((int64_t)(x + 1) * TOP_HISTORY / dots);
    *out_top = INT_MAX;
    *out_bottom = -1;
    // Begins with the value before, so that a jump is a line.
    for (int i = (first > 0) ? first - 1 : 0; i < ((last > first) ? last : first + 1); i++) {
        const int32_t value = plot->values[(slot + 1 + i) % TOP_HISTORY];
        if (value != UNKNOWN) {
            const int row = dot_row(plot, value);
            if (row < *out_top) {
                *out_top = row;
            }
            if (row > *out_bottom) {
                *out_bottom = row;
            }
        }
    }
    return *out_bottom >= 0;
}

/// Returns a dot of a braille cell, numbered as in Unicode.
static unsigned dot_bit(int x, int y) {
    static const unsigned char bits[2][BRAILLE_DOWN] = {{0x01, 0x02, 0x04, 0x40}, {0x08, 0x10, 0x20, 0x80}};
    return bits[x][y];
}

static size_t put_cell(bool fine, unsigned bits, bool zero, char out[CELL_SIZE]) {
    if (!fine || bits == 0U) {
        const char *empty = !zero ? " " : fine ? "\xC2\xB7" : ".";
        const char *text = (bits != 0U) ? "*" : empty;
        return (size_t)snprintf(out, CELL_SIZE, "%s", text);
    }
    out[0] = (char)0xE2;
    out[1] = (char)(0xA0U | (bits >> 6));
    out[2] = (char)(0x80U | (bits & 0x3FU));
    return 3U;
}

static void draw_row(const top_model_t *model, const plot_t *plot, int cell_row, int row, int column) {
    char text[3 * COLUMNS_MAX + CELL_SIZE];
    size_t used = 0;
    const bool zero = dot_row(plot, 0) / plot->down == cell_row;
    for (int cell = 0; cell < plot->columns; cell++) {
        unsigned bits = 0;
        for (int x = 0; x < plot->across; x++) {
            int top = 0;
            int bottom = 0;
            if (!reach(plot, model->history->slot, cell * plot->across + x, &top, &bottom)) {
                continue;
            }
            for (int y = 0; y < plot->down; y++) {
                const int dot = cell_row * plot->down + y;
                bits |= (dot >= top && dot <= bottom) ? dot_bit(x, y) : 0U;
            }
        }
        used += put_cell(model->fine_blocks, bits, zero, &text[used]);
    }
    text[used] = '\0';
    top_put(model, row, column, TOP_GOOD, "%s", text);
}

/// Draws one plot with its scale; the last row is the axis of time.
static void draw_plot(const top_model_t *model, int number, const place_t *place) {
    static const char *const names[TOP_PLOTS] = {"LEFT speed", "RIGHT speed", "LEFT force", "RIGHT force"};
    const bool force = number >= 2;
    bool negative = false;
    const int32_t limit =
        limit_of(&model->history->value[force ? 2 : 0], force ? FORCE_MIN_mN : SPEED_MIN_mm_s, &negative);
    const int row = place->row;
    const int column = place->column;
    const int space = place->columns - LABEL - 1;
    plot_t plot = {.values = model->history->value[number],
                   .columns = (space > COLUMNS_MAX) ? COLUMNS_MAX : space,
                   .rows = place->rows - 2,
                   .across = model->fine_blocks ? 2 : 1,
                   .down = model->fine_blocks ? BRAILLE_DOWN : 1,
                   .low = negative ? -limit : 0,
                   .high = limit};
    const int unit = force ? 1000 : 1;
    top_put(model, row, column + 1, TOP_TITLE, "%s, %s", names[number], force ? "N" : "mm/s");
    for (int i = 0; i < plot.rows; i++) {
        draw_row(model, &plot, i, row + 1 + i, column + LABEL);
    }
    top_put(model, row + 1, column, TOP_FAINT, "%+7d", (int)plot.high / unit);
    top_put(model, row + 1 + dot_row(&plot, 0) / plot.down, column, TOP_FAINT, "%7d", 0);
    if (negative) {
        top_put(model, row + place->rows - 2, column, TOP_FAINT, "%+7d", (int)plot.low / unit);
    }
    top_put(model, row + place->rows - 1, column + LABEL, TOP_FAINT, "60 s ago");
    top_put(model, row + place->rows - 1, column + LABEL + plot.columns - 3, TOP_FAINT, "now");
}

void top_draw_plots(const top_model_t *model, int row, int rows) {
    const int per_row = (COLS >= COLUMNS_TWO) ? 2 : 1;
    int plots = TOP_PLOTS;
    while (plots > 0 && rows / (plots / per_row) < ROWS_MIN) {
        plots -= 2; // Speed is drawn before force.
    }
    if (plots == 0 || COLS < 40 || model->history == NULL) {
        return;
    }
    const int each = rows / (plots / per_row);
    const int height = (each > ROWS_MAX) ? ROWS_MAX : each;
    const int width = COLS / per_row;
    for (int i = 0; i < plots; i++) {
        const place_t place = {row + (i / per_row) * height, (i % per_row) * width, height, width};
        draw_plot(model, i, &place);
    }
}
