// SPDX-License-Identifier: MIT
// What a message says.
#include "connection.h"

#include <string.h>

static iwc_span_t field(const iwc_message_t *message, const char *path) {
    return iwc_json_find((iwc_span_t){message->text, message->length}, path);
}

iwc_value_t iwc_integer(const iwc_message_t *message, const char *path) {
    iwc_value_t value = {false, 0};
    value.known = iwc_json_integer(field(message, path), &value.value);
    return value;
}

iwc_value_t iwc_truth(const iwc_message_t *message, const char *path) {
    const iwc_span_t value = field(message, path);
    const bool yes = value.length == 4 && memcmp(value.at, "true", 4) == 0;
    const bool no = value.length == 5 && memcmp(value.at, "false", 5) == 0;
    return (iwc_value_t){yes || no, yes ? 1 : 0};
}

/// Bytes of the character, or of the escape, that begins with `byte`.
static size_t unit_length(const char *at) {
    const unsigned char byte = (unsigned char)at[0];
    if (byte == '\\') {
        return (at[1] == 'u') ? 6 : 2;
    }
    return (byte < 0x80U) ? 1 : (byte < 0xE0U) ? 2 : (byte < 0xF0U) ? 3 : 4;
}

bool iwc_text(const iwc_message_t *message, const char *path, char *out, size_t size) {
    const iwc_span_t value = field(message, path);
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
        // Only these three lose their backslash; the rest may stand for what moves a terminal.
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

bool iwc_is(const iwc_message_t *message, const char *path, const char *text) {
    return iwc_json_is_text(field(message, path), text);
}

const char *iwc_json(const iwc_message_t *message, const char *path, size_t *out_length) {
    const iwc_span_t value = field(message, path);
    *out_length = value.length;
    return value.at;
}

static iwc_value_t integer_in(iwc_span_t object, const char *key) {
    iwc_value_t value = {false, 0};
    value.known = iwc_json_integer(iwc_json_find(object, key), &value.value);
    return value;
}

static void read_wheel(const iwc_message_t *message, const char *side, iwc_wheel_t *out_wheel) {
    const iwc_span_t wheel = field(message, side);
    const iwc_message_t inner = {.text = wheel.at, .length = wheel.length};
    *out_wheel = (iwc_wheel_t){
        .heard = iwc_truth(&inner, "heard").value == 1,
        .at_rest = iwc_truth(&inner, "at_rest"),
        .speed_mm_s = integer_in(wheel, "speed_mm_s"),
        .commanded_mm_s = integer_in(wheel, "commanded_mm_s"),
        .applied_mm_s = integer_in(wheel, "applied_mm_s"),
        .distance_mm = integer_in(wheel, "distance_mm"),
        .battery_dV = integer_in(wheel, "battery_dV"),
        .temperature_degC = integer_in(wheel, "temperature_degC"),
        .speed_age_ms = integer_in(wheel, "speed_age_ms"),
        .force_age_ms = integer_in(wheel, "force_age_ms"),
    };
    if (iwc_is(&inner, "force_validity", "valid")) {
        out_wheel->force_net_mN = integer_in(wheel, "force_net_mN");
    }
}

static iwc_machine_t machine_of(const iwc_message_t *message) {
    static const char *const names[] = {
        [IWC_LISTENING] = "listening", [IWC_ARMED] = "armed", [IWC_STOPPING] = "stopping", [IWC_LATCHED] = "latched"};
    for (unsigned i = IWC_LISTENING; i <= (unsigned)IWC_LATCHED; i++) {
        if (iwc_is(message, "state", names[i])) {
            return (iwc_machine_t)i;
        }
    }
    return IWC_STATE_UNKNOWN;
}

bool iwc_state(const iwc_t *self, const iwc_message_t *message, iwc_state_t *out_state) {
    size_t length = 0;
    if (iwc_json(message, "left", &length) == NULL || iwc_json(message, "right", &length) == NULL ||
        iwc_json(message, "lease", &length) == NULL || iwc_json(message, "state", &length) == NULL) {
        return false;
    }
    memset(out_state, 0, sizeof(*out_state));
    out_state->t_us = iwc_integer(message, "t_us").value;
    out_state->machine = machine_of(message);
    (void)iwc_text(message, "cause", out_state->cause, sizeof out_state->cause);
    out_state->holder = iwc_integer(message, "lease.holder");
    out_state->ours = out_state->holder.known && self->number != 0 && out_state->holder.value == self->number;
    out_state->remaining_ms = iwc_integer(message, "lease.remaining_ms");
    out_state->estop_released = iwc_is(message, "estop.state", "released");
    out_state->bus_active = iwc_is(message, "bus.state", "active");
    read_wheel(message, "left", &out_state->left);
    read_wheel(message, "right", &out_state->right);
    return true;
}
