// SPDX-License-Identifier: MIT
#include "iwheel_northbound/json_out.h"

#include "iwheel_northbound/text.h"

// One copy of each function with a name argument, for programs compiled for size.
#ifdef __OPTIMIZE_SIZE__
#include "iwheel_northbound/json_out_inline.h"
#endif

#define EXTENDED_ID_MASK 0x1FFFFFFFU

static void put(iwn_out_t *self, const char *text, size_t length) {
    if (self->overflow || length >= self->size - self->length) {
        self->overflow = true;
        return;
    }
    memcpy(&self->data[self->length], text, length);
    self->length += length;
}

void iwn_out_init(iwn_out_t *self, char *data, size_t size) {
    *self = (iwn_out_t){.data = data, .size = size};
}

void iwn_out_close(iwn_out_t *self, char bracket) {
    put(self, &bracket, 1U);
    self->comma = true;
}

void iwn_out_span(iwn_out_t *self, iwn_span_t name, iwn_span_t value) {
    char *const at = iwn_out_begin(self, name, value.length);
    if (at != NULL) {
        memcpy(at, value.text, value.length);
    }
}

void iwn_out_numbers(iwn_out_t *self, const char *names, const uint32_t *values) {
    for (; *names != '\0'; names += strlen(names) + 1U) {
        iwn_out_int(self, names, (int64_t)*values++);
    }
}

/// Writes one character, escaped if necessary. Returns its number of bytes in `text`.
static size_t put_character(iwn_out_t *self, const char *text) {
    char escape[7];
    size_t bytes;
    iwn_text_t written = iwn_text_begin(escape, sizeof escape);
    const uint32_t code_point = iwn_plain_read(text, &bytes);
    if (code_point == '"' || code_point == '\\') {
        iwn_text_add(&written, "\\");
        iwn_text_span(&written, text, 1U);
    } else if (iwn_plain_is(code_point)) {
        iwn_text_span(&written, text, bytes);
    } else {
        iwn_text_add(&written, "\\u");
        iwn_text_hex(&written, (code_point == IWN_PLAIN_BROKEN) ? 0xFFFDU : code_point, 4U);
    }
    put(self, escape, written.length);
    return bytes;
}

/// Writes the rest of a string, with escapes.
static void put_escaped(iwn_out_t *self, const char *text, size_t length) {
    size_t at = 0;
    while (at < length) {
        at += put_character(self, &text[at]);
        const size_t plain = iwn_plain_length(&text[at], length - at);
        put(self, &text[at], plain);
        at += plain;
    }
}

void iwn_out_string(iwn_out_t *self, iwn_span_t name, const char *text) {
    if (text == NULL) {
        iwn_out_span(self, name, (iwn_span_t){"null", 4U});
        return;
    }
    const size_t length = strlen(text);
    const size_t plain = iwn_plain_length(text, length);
    char *const at = iwn_out_begin(self, name, plain + ((plain == length) ? 2U : 1U));
    if (at == NULL) {
        return;
    }
    at[0] = '"';
    memcpy(at + 1, text, plain);
    if (plain == length) {
        at[length + 1U] = '"';
        return;
    }
    put_escaped(self, &text[plain], length - plain);
    put(self, "\"", 1U);
}

size_t iwn_out_finish(iwn_out_t *self) {
    put(self, "\n", 1U);
    return self->overflow ? 0U : self->length;
}

void iwn_out_frame(const iw_can_frame_t *frame, iw_time_us_t at_us, iwn_out_t *json) {
    const bool extended = (frame->id & IW_CAN_EXTENDED) != 0U;
    char data[2U * IW_CAN_DATA_MAX + 1U];
    iwn_text_t hex = iwn_text_begin(data, sizeof data);
    for (size_t i = 0; i < frame->dlc && i < IW_CAN_DATA_MAX; i++) {
        iwn_text_hex(&hex, frame->data[i], 2U);
    }
    iwn_out_int(json, "t_us", (int64_t)at_us);
    iwn_out_int(json, "id", frame->id & (extended ? EXTENDED_ID_MASK : IW_CAN_ID_MASK));
    iwn_out_int(json, "dlc", frame->dlc);
    iwn_out_text(json, "data", data);
    iwn_out_text(json, "kind", (frame->kind == (uint8_t)IW_CAN_ECHO) ? "echo" : "received");
    iwn_out_open(json, "flags", '[');
    if (extended) {
        iwn_out_text(json, NULL, "extended");
    }
    if ((frame->id & IW_CAN_REMOTE) != 0U) {
        iwn_out_text(json, NULL, "remote");
    }
    if (!extended && (frame->id & IW_CAN_FD) != 0U) {
        iwn_out_text(json, NULL, "fd");
    }
    iwn_out_close(json, ']');
}
