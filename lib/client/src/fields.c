// SPDX-License-Identifier: MIT
// Reads the fields of messages.
#include "connection.h"

#include <string.h>

#define WALK(walk, key) iwc_json_walk((walk), (key), sizeof(key) - 1U)

static iwc_span_t field(const iwc_message_t *message, const char *path) {
    return iwc_json_find((iwc_span_t){message->text, message->length}, path);
}

static iwc_value_t integer_of(iwc_span_t span) {
    iwc_value_t value = {false, 0};
    value.known = iwc_json_integer(span, &value.value);
    return value;
}

static iwc_value_t truth_of(iwc_span_t value) {
    const bool yes = value.length == 4 && memcmp(value.at, "true", 4) == 0;
    const bool no = value.length == 5 && memcmp(value.at, "false", 5) == 0;
    return (iwc_value_t){yes || no, yes ? 1 : 0};
}

iwc_value_t iwc_integer(const iwc_message_t *message, const char *path) {
    return integer_of(field(message, path));
}

iwc_value_t iwc_truth(const iwc_message_t *message, const char *path) {
    return truth_of(field(message, path));
}

/// Returns the length in bytes of the character or escape at `at`.
static size_t unit_length(const char *at) {
    const unsigned char byte = (unsigned char)at[0];
    if (byte == '\\') {
        return (at[1] == 'u') ? 6 : 2;
    }
    return (byte < 0x80U) ? 1 : (byte < 0xE0U) ? 2 : (byte < 0xF0U) ? 3 : 4;
}

static bool copy_text(iwc_span_t value, char *out, size_t size) {
    size_t used = 0;
    if (size == 0) {
        return false;
    }
    out[0] = '\0';
    if (value.at == NULL || value.at[0] != '"') {
        return false;
    }
    for (size_t at = 1; at + 1U < value.length;) {
        const size_t length = unit_length(value.at + at);
        // Only these three lose their backslash; other escapes may stand for control characters.
        const size_t escape = (value.at[at] == '\\' && strchr("\"\\/", value.at[at + 1U]) != NULL) ? 1 : 0;
        if (used + length - escape >= size) {
            break;
        }
        memcpy(out + used, value.at + at + escape, length - escape);
        used += length - escape;
        at += length;
    }
    out[used] = '\0';
    return true;
}

bool iwc_text(const iwc_message_t *message, const char *path, char *out, size_t size) {
    return copy_text(field(message, path), out, size);
}

bool iwc_is(const iwc_message_t *message, const char *path, const char *text) {
    return iwc_json_is_text(field(message, path), text);
}

const char *iwc_json(const iwc_message_t *message, const char *path, size_t *out_length) {
    const iwc_span_t value = field(message, path);
    *out_length = value.length;
    return value.at;
}

iwc_message_t iwc_field(iwc_cursor_t *self, const char *name) {
    iwc_walk_t walk = {{self->message->text, self->message->length}, self->rest};
    const iwc_span_t value = iwc_json_walk(&walk, name, strlen(name));
    self->rest = walk.rest;
    return (iwc_message_t){.text = value.at, .length = value.length, .is_event = self->message->is_event};
}

/// Reads the fields in the order of the gateway, so that one walk finds all. Another order only takes longer.
static void read_wheel(iwc_span_t span, iwc_wheel_t *out_wheel) {
    iwc_walk_t wheel = {span, NULL};
    memset(out_wheel, 0, sizeof *out_wheel);
    out_wheel->heard = truth_of(WALK(&wheel, "heard")).value == 1;
    out_wheel->at_rest = truth_of(WALK(&wheel, "at_rest"));
    out_wheel->speed_mm_s = integer_of(WALK(&wheel, "speed_mm_s"));
    out_wheel->commanded_mm_s = integer_of(WALK(&wheel, "commanded_mm_s"));
    out_wheel->applied_mm_s = integer_of(WALK(&wheel, "applied_mm_s"));
    out_wheel->speed_age_ms = integer_of(WALK(&wheel, "speed_age_ms"));
    out_wheel->battery_dV = integer_of(WALK(&wheel, "battery_dV"));
    out_wheel->temperature_degC = integer_of(WALK(&wheel, "temperature_degC"));
    out_wheel->distance_mm = integer_of(WALK(&wheel, "distance_mm"));
    const iwc_value_t force_net_mN = integer_of(WALK(&wheel, "force_net_mN"));
    if (iwc_json_is_text(WALK(&wheel, "force_validity"), "valid")) {
        out_wheel->force_net_mN = force_net_mN;
    }
    out_wheel->force_age_ms = integer_of(WALK(&wheel, "force_age_ms"));
}

static iwc_machine_t machine_of(iwc_span_t state) {
    static const char *const names[] = {
        [IWC_LISTENING] = "listening", [IWC_ARMED] = "armed", [IWC_STOPPING] = "stopping", [IWC_LATCHED] = "latched"};
    for (unsigned i = IWC_LISTENING; i <= (unsigned)IWC_LATCHED; i++) {
        if (iwc_json_is_text(state, names[i])) {
            return (iwc_machine_t)i;
        }
    }
    return IWC_STATE_UNKNOWN;
}

bool iwc_state(const iwc_t *self, const iwc_message_t *message, iwc_state_t *out_state) {
    iwc_walk_t snapshot = {{message->text, message->length}, NULL};
    const iwc_span_t t_us = WALK(&snapshot, "t_us");
    const iwc_span_t state = WALK(&snapshot, "state");
    const iwc_span_t cause = WALK(&snapshot, "cause");
    iwc_walk_t lease = {WALK(&snapshot, "lease"), NULL};
    const iwc_span_t bus = WALK(&snapshot, "bus");
    const iwc_span_t estop = WALK(&snapshot, "estop");
    const iwc_span_t left = WALK(&snapshot, "left");
    const iwc_span_t right = WALK(&snapshot, "right");
    if (left.at == NULL || right.at == NULL || lease.object.at == NULL || state.at == NULL) {
        return false;
    }
    memset(out_state, 0, sizeof(*out_state));
    out_state->t_us = integer_of(t_us).value;
    out_state->machine = machine_of(state);
    (void)copy_text(cause, out_state->cause, sizeof out_state->cause);
    out_state->holder = integer_of(WALK(&lease, "holder"));
    out_state->ours = out_state->holder.known && self->number != 0 && out_state->holder.value == self->number;
    out_state->remaining_ms = integer_of(WALK(&lease, "remaining_ms"));
    out_state->estop_released = iwc_json_is_text(iwc_json_find(estop, "state"), "released");
    out_state->bus_active = iwc_json_is_text(iwc_json_find(bus, "state"), "active");
    read_wheel(left, &out_state->left);
    read_wheel(right, &out_state->right);
    return true;
}
