// SPDX-License-Identifier: MIT
#include "button.h"

#include "iwheel_linux/clock.h"

#include <stdio.h>
#include <string.h>

/// Reads the identities of all lines. Returns false if one cannot be read.
static bool see(const iwl_hal_t *hal, iwl_estop_seen_t seen[IWL_ESTOP_CONTACTS]) {
    memset(seen, 0, IWL_ESTOP_CONTACTS * sizeof seen[0]);
    return hal->estop_ops->present && !hal->estop_ops->simulated && iwl_hal_estop_seen(hal, 0, &seen[0]) &&
           (!hal->two_contacts || iwl_hal_estop_seen(hal, 1, &seen[1]));
}

/// A second contact that does not exist has no polarity. Data from before second contacts existed have no name for it.
static bool is_same_contact(const gw_button_t *self, const iwl_estop_seen_t *seen, const gw_tried_t *tried,
                            unsigned i) {
    const char *line = (tried->contact[i].line[0] != '\0') ? tried->contact[i].line : "none";
    const bool none = strcmp(line, "none") == 0;
    return strcmp(self->contact[i].line, line) == 0 &&
           (none || self->contact[i].active_high == tried->contact[i].active_high) &&
           strcmp(seen->chip, tried->contact[i].seen.chip) == 0 && strcmp(seen->line, tried->contact[i].seen.line) == 0;
}

static void note(const gw_button_t *self, const iwl_estop_seen_t seen[IWL_ESTOP_CONTACTS], gw_tried_t *out_tried) {
    memset(out_tried, 0, sizeof *out_tried);
    out_tried->wall_us = iwl_clock_wall_us();
    for (unsigned i = 0; i < IWL_ESTOP_CONTACTS; i++) {
        out_tried->contact[i].active_high = self->contact[i].active_high;
        (void)snprintf(out_tried->contact[i].line, sizeof out_tried->contact[i].line, "%s", self->contact[i].line);
        out_tried->contact[i].seen = seen[i];
    }
}

typedef enum { UNREADABLE, NONE_PRESSED, SOME_PRESSED, ALL_PRESSED } answer_t;

/// Combines the readings of all contacts.
static answer_t said_by_all(const iwl_hal_t *hal) {
    const int first = hal->contact_last[0];
    const int second = hal->two_contacts ? hal->contact_last[1] : first;
    if (first < 0 || second < 0) {
        return UNREADABLE;
    }
    if ((first > 0) != (second > 0)) {
        return SOME_PRESSED;
    }
    return (first > 0) ? ALL_PRESSED : NONE_PRESSED;
}

/// Returns true if the reading ends a press.
static bool follow(gw_button_t *self, answer_t answer, iw_time_us_t now_us) {
    if (answer == UNREADABLE) {
        self->state = GW_BUTTON_UNKNOWN;
        return false;
    }
    if (answer == ALL_PRESSED) {
        if (self->state == GW_BUTTON_RELEASED) {
            self->state = GW_BUTTON_PRESSED;
            self->pressed_us = now_us;
        }
        return false;
    }
    if (self->state == GW_BUTTON_PRESSED) {
        const bool lasted = now_us - self->pressed_us >= GW_BUTTON_PRESS_US + self->debounce_us;
        self->state = lasted ? GW_BUTTON_SHOWN : GW_BUTTON_RELEASED;
    }
    if (answer == SOME_PRESSED) {
        return false;
    }
    const bool shown = self->state == GW_BUTTON_SHOWN;
    self->state = GW_BUTTON_RELEASED;
    return shown;
}

/// The result depends on the last readings, and on no time except that of the contacts' own check.
static bool is_news(gw_button_t *self, const iwl_hal_t *hal) {
    const bool disagrees = hal->estop_last == IW_ESTOP_DISAGREES;
    const bool news =
        !self->polled || memcmp(self->last, hal->contact_last, sizeof self->last) != 0 || disagrees != self->disagreed;
    self->disagreed = disagrees;
    self->polled = true;
    memcpy(self->last, hal->contact_last, sizeof self->last);
    return news;
}

gw_button_news_t gw_button_poll(gw_button_t *self, const iwl_hal_t *hal, iw_time_us_t now_us, gw_tried_t *tried) {
    iwl_estop_seen_t seen[IWL_ESTOP_CONTACTS];
    if (!is_news(self, hal)) {
        return GW_BUTTON_NO_NEWS;
    }
    const bool known = see(hal, seen);
    if (follow(self, known ? said_by_all(hal) : UNREADABLE, now_us) && !self->disagreed) {
        note(self, seen, tried);
        return GW_BUTTON_TRIED;
    }
    // A stuck contact reads released at the next start; only the stored data can reveal it then.
    if (self->disagreed && tried->wall_us != 0) {
        memset(tried, 0, sizeof *tried);
        return GW_BUTTON_BROKEN;
    }
    const bool same = is_same_contact(self, &seen[0], tried, 0) && is_same_contact(self, &seen[1], tried, 1);
    if (known && tried->wall_us != 0 && !same) {
        memset(tried, 0, sizeof *tried);
        return GW_BUTTON_VOID;
    }
    return GW_BUTTON_NO_NEWS;
}

static const struct {
    const char *line, *active_high, *chip, *chip_line;
} fields[IWL_ESTOP_CONTACTS] = {{"line", "active_high", "chip", "chip_line"},
                                {"line2", "active2_high", "chip2", "chip2_line"}};

void gw_tried_write(const gw_tried_t *tried, iwn_out_t *json) {
    for (unsigned i = 0; i < IWL_ESTOP_CONTACTS; i++) {
        iwn_out_text(json, fields[i].line, tried->contact[i].line);
        iwn_out_bool(json, fields[i].active_high, tried->contact[i].active_high);
        iwn_out_text(json, fields[i].chip, tried->contact[i].seen.chip);
        iwn_out_text(json, fields[i].chip_line, tried->contact[i].seen.line);
    }
    iwn_out_int(json, "wall_us", tried->wall_us);
}

static bool read_text(iwn_json_t object, const char *field, char *out_text, size_t size) {
    iwn_json_t value;
    return iwn_json_find(object, field, &value) && iwn_json_text(value, out_text, size);
}

static bool read_contact(iwn_json_t object, unsigned i, gw_tried_t *out_tried) {
    iwn_json_t value;
    if (!iwn_json_find(object, fields[i].active_high, &value) ||
        (iwn_json_kind(value) != IWN_JSON_TRUE && iwn_json_kind(value) != IWN_JSON_FALSE)) {
        return false;
    }
    out_tried->contact[i].active_high = iwn_json_kind(value) == IWN_JSON_TRUE;
    return read_text(object, fields[i].line, out_tried->contact[i].line, sizeof out_tried->contact[i].line) &&
           read_text(object, fields[i].chip, out_tried->contact[i].seen.chip, sizeof out_tried->contact[i].seen.chip) &&
           read_text(object, fields[i].chip_line, out_tried->contact[i].seen.line,
                     sizeof out_tried->contact[i].seen.line);
}

/// Data from before second contacts existed have no second contact.
bool gw_tried_read(iwn_json_t object, gw_tried_t *out_tried) {
    iwn_json_t value;
    memset(out_tried, 0, sizeof *out_tried);
    if (!iwn_json_find(object, "wall_us", &value) || iwn_json_kind(value) != IWN_JSON_INTEGER) {
        return false;
    }
    out_tried->wall_us = iwn_json_integer(value);
    const bool has_second = iwn_json_find(object, fields[1].line, &value);
    return out_tried->wall_us > 0 && read_contact(object, 0, out_tried) &&
           (!has_second || read_contact(object, 1, out_tried));
}
