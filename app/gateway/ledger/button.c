// SPDX-License-Identifier: MIT
#include "button.h"

#include "iwheel_linux/clock.h"

#include <stdio.h>
#include <string.h>

static bool is_same(const gw_button_t *self, const iw_estop_seen_t *seen, const gw_tried_t *tried) {
    return self->active_high == tried->active_high && strcmp(self->line, tried->line) == 0 &&
           strcmp(seen->chip, tried->seen.chip) == 0 && strcmp(seen->line, tried->seen.line) == 0;
}

/// True if the answer ends a press.
static bool follow(gw_button_t *self, int answer, iw_time_us_t now_us) {
    const gw_button_state_t before = self->state;
    if (answer < 0) {
        self->state = GW_BUTTON_UNKNOWN;
        return false;
    }
    if (answer == 0) {
        self->state = GW_BUTTON_RELEASED;
        return before == GW_BUTTON_PRESSED && now_us - self->pressed_us >= GW_BUTTON_PRESS_US;
    }
    if (before == GW_BUTTON_RELEASED) {
        self->state = GW_BUTTON_PRESSED;
        self->pressed_us = now_us;
    }
    return false;
}

gw_button_news_t gw_button_look(gw_button_t *self, const iw_linux_hal_t *hal, iw_time_us_t now_us, gw_tried_t *tried) {
    iw_estop_seen_t seen;
    const bool known = hal->estop_ops->present && !hal->estop_ops->simulated && iw_linux_hal_estop_seen(hal, &seen);
    if (follow(self, known ? hal->estop_last : -1, now_us)) {
        memset(tried, 0, sizeof *tried);
        tried->wall_us = iw_clock_wall_us();
        tried->active_high = self->active_high;
        (void)snprintf(tried->line, sizeof tried->line, "%s", self->line);
        tried->seen = seen;
        return GW_BUTTON_TRIED;
    }
    if (known && tried->wall_us != 0 && !is_same(self, &seen, tried)) {
        memset(tried, 0, sizeof *tried);
        return GW_BUTTON_VOID;
    }
    return GW_BUTTON_NO_NEWS;
}

void gw_tried_write(const gw_tried_t *tried, iwn_out_t *json) {
    iwn_out_text(json, "line", tried->line);
    iwn_out_bool(json, "active_high", tried->active_high);
    iwn_out_text(json, "chip", tried->seen.chip);
    iwn_out_text(json, "chip_line", tried->seen.line);
    iwn_out_int(json, "wall_us", tried->wall_us);
}

static bool read_text(iwn_json_t object, const char *field, char *out_text, size_t size) {
    iwn_json_t value;
    return iwn_json_find(object, field, &value) && iwn_json_text(value, out_text, size);
}

bool gw_tried_read(iwn_json_t object, gw_tried_t *out_tried) {
    iwn_json_t value;
    memset(out_tried, 0, sizeof *out_tried);
    if (!iwn_json_find(object, "wall_us", &value) || iwn_json_kind(value) != IWN_JSON_INTEGER) {
        return false;
    }
    out_tried->wall_us = iwn_json_integer(value);
    if (!iwn_json_find(object, "active_high", &value) ||
        (iwn_json_kind(value) != IWN_JSON_TRUE && iwn_json_kind(value) != IWN_JSON_FALSE)) {
        return false;
    }
    out_tried->active_high = iwn_json_kind(value) == IWN_JSON_TRUE;
    return out_tried->wall_us > 0 && read_text(object, "line", out_tried->line, sizeof out_tried->line) &&
           read_text(object, "chip", out_tried->seen.chip, sizeof out_tried->seen.chip) &&
           read_text(object, "chip_line", out_tried->seen.line, sizeof out_tried->seen.line);
}
