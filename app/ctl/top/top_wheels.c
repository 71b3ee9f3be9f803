// SPDX-License-Identifier: MIT
// Both wheels: what they are told and what they do, as bars on one scale, and the rest in numbers.
#include "text/text.h"
#include "top.h"

#include <curses.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LABEL_COLUMNS 13
#define VALUE_COLUMNS 14
#define BAR_MIN       9

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
        largest = (speed > largest) ? speed : largest;
    }
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        if (largest <= steps[i]) {
            return steps[i];
        }
    }
    return largest;
}

/// A bar from its middle to the value's place; nothing but the middle if the value is unknown.
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
    long long length = (llabs(speed) * half + model->scale_mm_s / 2) / model->scale_mm_s;
    length = (length > half) ? half : length;
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

/// An integer as fewer decimals than it has: what is read across a room needs no thousandths.
static void coarse(const json_t *value, int divisor, unsigned digits, const char *unit, char out[TEXT_CELL]) {
    json_t *rounded = json_is_integer(value) ? json_integer(json_integer_value(value) / divisor) : json_null();
    text_decimal(rounded, digits, unit, out);
    json_decref(rounded);
}

/// How many rows it took: on a narrow terminal two.
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
    const bool heard = json_is_true(get(wheel, "heard"));
    char told[24];
    char does[24];
    (void)snprintf(told, sizeof told, "%-6s told", name);
    (void)snprintf(does, sizeof does, "%-6s %s", "", heard ? "does" : "LOST");
    draw_speed(model, row, told, TOP_CARE, get(wheel, "applied_mm_s"));
    draw_speed(model, row + 1, does, heard ? TOP_GOOD : TOP_BAD, get(wheel, "speed_mm_s"));
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
