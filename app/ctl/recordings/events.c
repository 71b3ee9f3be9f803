// SPDX-License-Identifier: MIT
#include "events.h"

#include "talk/ctl.h"

#include "iwheel_northbound/words.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define PRINTED_MAX 10U

static int64_t integer(const json_t *line, const char *name) {
    return json_integer_value(json_object_get(line, name));
}

/// Returns the index of a word in the list of `name_of`; `count` if it is not in the list.
static unsigned word_of(const json_t *line, const char *name, const char *(*name_of)(unsigned), unsigned count) {
    const char *word = json_string_value(json_object_get(line, name));
    for (unsigned i = 0; word != NULL && i < count; i++) {
        if (strcmp(word, name_of(i)) == 0) {
            return i;
        }
    }
    return count;
}

/// Defines a function that returns the protocol's name of a number.
#define NAMES(of_, function_, type_)                                                                                   \
    static const char *of_##_name(unsigned number) {                                                                   \
        return function_((type_)number);                                                                               \
    }
NAMES(bus, iwn_bus_state_name, iw_bus_state_t)
NAMES(state, iwn_state_name, iw_state_t)
NAMES(cause, iwn_cause_name, iw_cause_t)
NAMES(item, iwn_assumption_item_name, iw_assumption_item_t)
NAMES(assumption_state, iwn_assumption_state_name, iw_assumption_state_t)
NAMES(source, iwn_source_name, iw_source_t)

static const char *refusal_name(unsigned refusal) {
    return iwn_error_name(iwn_error_of((iw_refusal_t)refusal));
}

static const char *side_name(unsigned sides) {
    const char *name = iwn_sides_name((uint8_t)sides);
    return (name != NULL) ? name : "";
}

static uint8_t flag(const json_t *line, const char *name) {
    return json_is_true(json_object_get(line, name)) ? 1U : 0U;
}

/// Reads a word. Returns false if it is unknown.
static bool take_word(const json_t *line, const char *name, const char *(*name_of)(unsigned), unsigned count,
                      uint8_t *out) {
    const unsigned value = word_of(line, name, name_of, count);
    *out = (uint8_t)value;
    return value < count;
}

static bool take_refusal(const json_t *line, uint8_t *out) {
    if (json_is_null(json_object_get(line, "refused"))) {
        *out = IW_REFUSE_NONE;
        return true;
    }
    return take_word(line, "refused", refusal_name, IW_REFUSALS, out);
}

static int32_t limited(int64_t value, int64_t limit) {
    return (int32_t)((value > limit) ? limit : (value < -limit - 1) ? -limit - 1 : value);
}

static void take_speeds(const json_t *line, const char *left, const char *right, blackbox_drive_t *out) {
    out->speed_mm_s[IW_LEFT] = limited(integer(line, left), INT32_MAX);
    out->speed_mm_s[IW_RIGHT] = limited(integer(line, right), INT32_MAX);
}

static bool take_drive(const json_t *line, blackbox_entry_t *out) {
    const int64_t age_us = integer(line, "age_us");
    out->a = json_is_integer(json_object_get(line, "left_mA")) ? 1U : 0U;
    out->as.drive.current_mA[IW_LEFT] = (int16_t)limited(integer(line, "left_mA"), INT16_MAX);
    out->as.drive.current_mA[IW_RIGHT] = (int16_t)limited(integer(line, "right_mA"), INT16_MAX);
    out->as.drive.age_us = (age_us < 0) ? 0U : (age_us > UINT32_MAX) ? UINT32_MAX : (uint32_t)age_us;
    take_speeds(line, "left_mm_s", "right_mm_s", &out->as.drive);
    return take_refusal(line, &out->b);
}

static bool take_decision(const json_t *line, blackbox_entry_t *out) {
    if (out->kind == (uint8_t)BLACKBOX_STATE) {
        take_speeds(line, "applied_left_mm_s", "applied_right_mm_s", &out->as.drive);
        return take_word(line, "state", state_name, IW_STATE_LATCHED + 1U, &out->a) &&
               take_word(line, "before", state_name, IW_STATE_LATCHED + 1U, &out->b);
    }
    const unsigned sides = word_of(line, "side", side_name, IW_SIDES_BOTH + 1U);
    out->b = (uint8_t)((sides > IW_SIDES_BOTH) ? IW_SIDES_NONE : sides);
    out->as.value = integer(line, "detail");
    out->number = (uint32_t)integer(line, "number");
    return take_word(line, "cause", cause_name, IW_CAUSES, &out->a);
}

static bool take_assumption(const json_t *line, blackbox_entry_t *out) {
    const unsigned source = word_of(line, "evidence", source_name, IW_SOURCE_OPERATOR + 1U);
    const unsigned states = IW_CONTRADICTED + 1U;
    out->number = source;
    out->as.value = limited(integer(line, "figure"), INT32_MAX);
    return source <= IW_SOURCE_OPERATOR && take_word(line, "item", item_name, IW_ASSUMPTION_ITEMS, &out->a) &&
           take_word(line, "state", assumption_state_name, states, &out->b);
}

static bool take_fields(const json_t *line, blackbox_entry_t *out) {
    switch (out->kind) {
    case BLACKBOX_DRIVE:
        return take_drive(line, out);
    case BLACKBOX_STATE:
    case BLACKBOX_STOPPED:
        return take_decision(line, out);
    case BLACKBOX_BUS:
        return take_word(line, "state", bus_name, IW_BUS_ACTIVE + 1U, &out->a);
    case BLACKBOX_START:
        out->a = flag(line, "restarted");
        out->b = flag(line, "listen_only");
        return true;
    case BLACKBOX_FACTS:
        out->a = flag(line, "timing_contradicted");
        out->b = flag(line, "echo_proven");
        return true;
    case BLACKBOX_SUSPENDED:
        out->as.value = integer(line, "suspended_us");
        return true;
    case BLACKBOX_ARM:
        out->a = flag(line, "takeover");
        return take_refusal(line, &out->b);
    case BLACKBOX_RESET:
    case BLACKBOX_RELEASE:
        return take_refusal(line, &out->b);
    case BLACKBOX_STOP:
        return take_word(line, "cause", cause_name, IW_CAUSES, &out->a);
    case BLACKBOX_TARE:
        out->a = (uint8_t)(word_of(line, "side", side_name, IW_SIDES_BOTH + 1U) - 1U);
        return out->a < IW_SIDES;
    case BLACKBOX_ASSUMPTION:
        return take_assumption(line, out);
    case BLACKBOX_NOT_SENT:
        out->number = (uint32_t)integer(line, "id");
        out->as.value = limited(integer(line, "answer"), INT32_MAX);
        return true;
    default:
        out->as.value = limited(integer(line, "answer"), INT32_MAX);
        return true;
    }
}

/// Reads the entry of a line. Returns false if it is not an entry.
static bool take_entry(events_t *self, const json_t *line, blackbox_entry_t *out, uint64_t *out_frames) {
    const char *type = json_string_value(json_object_get(line, "type"));
    const blackbox_kind_t kind = (type != NULL) ? blackbox_kind_of(type) : BLACKBOX_KINDS;
    const int64_t at_us = integer(line, "t_us");
    const int64_t frames = integer(line, "frames");
    (void)self;
    *out = (blackbox_entry_t){.kind = (uint8_t)kind, .at_us = (at_us > 0) ? (uint64_t)at_us : 0U};
    out->number = (uint32_t)integer(line, "client");
    *out_frames = (frames > 0) ? (uint64_t)frames : 0U;
    return kind != BLACKBOX_KINDS && kind != BLACKBOX_FRAME && take_fields(line, out);
}

/// Returns the next line as an object; NULL at the end, or for a line that is not an object, which has been reported.
static json_t *next_line(events_t *self, bool *out_end) {
    json_error_t error;
    const ssize_t length = getline(&self->line, &self->line_size, self->file);
    *out_end = length <= 0;
    if (*out_end) {
        return NULL;
    }
    self->number++;
    json_t *line = json_loadb(self->line, (size_t)length, 0, &error);
    if (line == NULL) {
        self->bad++;
        if (self->bad <= PRINTED_MAX) {
            (void)ctl_fail(CTL_DATA, "%s:%" PRIu64 ": not a JSON object (%s); left out: is the file cut?", self->name,
                           self->number, error.text);
        }
    }
    return line;
}

bool events_open(events_t *self, const char *path, FILE *file) {
    bool end = false;
    *self = (events_t){.name = path, .file = file};
    if (self->file == NULL) {
        return false;
    }
    self->head = next_line(self, &end);
    const char *type = json_string_value(json_object_get(self->head, "type"));
    if (type == NULL || strcmp(type, "blackbox") != 0) {
        (void)ctl_fail(CTL_DATA,
                       "%s: this is not the file that the gateway writes next to its recordings; "
                       "move it away, or use the recording's own",
                       path);
        events_close(self);
        errno = EPROTO;
        return false;
    }
    self->why = next_line(self, &end);
    return true;
}

void events_close(events_t *self) {
    json_decref(self->head);
    json_decref(self->why);
    free(self->line);
    if (self->file != NULL) {
        (void)fclose(self->file);
    }
    *self = (events_t){.name = self->name};
}

/// Reads a line that is not an entry: the number of missing entries, or the end.
static bool take_other(events_t *self, const json_t *line) {
    const char *type = json_string_value(json_object_get(line, "type"));
    if (type != NULL && strcmp(type, "lost") == 0) {
        self->lost += (uint64_t)integer(line, "entries");
        return true;
    }
    if (type != NULL && strcmp(type, "end") == 0) {
        self->whole = true;
        return true;
    }
    return false;
}

bool events_next(events_t *self, blackbox_entry_t *out_entry, uint64_t *out_frames) {
    bool end = false;
    while (self->file != NULL && !end) {
        json_t *line = next_line(self, &end);
        const bool good = line != NULL && take_entry(self, line, out_entry, out_frames);
        if (line != NULL && !good && !take_other(self, line)) {
            self->bad++;
            if (self->bad <= PRINTED_MAX) {
                (void)ctl_fail(CTL_DATA, "%s:%" PRIu64 ": not an entry of a recording; left out", self->name,
                               self->number);
            }
        }
        json_decref(line);
        if (good) {
            return true;
        }
    }
    return false;
}
