// SPDX-License-Identifier: MIT
#include "iwheel_northbound/json_out.h"

#include "iwheel_northbound/text.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define EXTENDED_ID_MASK 0x1FFFFFFFU

static void put(iwn_out_t *self, const char *text, size_t length) {
    if (self->overflow || length >= self->size - self->length) {
        self->overflow = true;
        return;
    }
    (void)memcpy(&self->data[self->length], text, length);
    self->length += length;
}

static void put_text(iwn_out_t *self, const char *text) {
    put(self, text, strlen(text));
}

/// One character; what moves a terminal as its number, a byte that is no UTF-8 as U+FFFD.
static size_t put_character(iwn_out_t *self, const char *text) {
    size_t bytes;
    char escape[16];
    const uint32_t code_point = iwn_plain_read(text, &bytes);
    if (code_point == '"' || code_point == '\\') {
        escape[0] = '\\';
        escape[1] = *text;
        put(self, escape, 2U);
    } else if (!iwn_plain_is(code_point)) {
        const uint32_t shown = code_point == IWN_PLAIN_BROKEN ? 0xFFFDU : code_point;
        (void)snprintf(escape, sizeof escape, "\\u%04X", (unsigned)shown);
        put_text(self, escape);
    } else {
        put(self, text, bytes);
    }
    return bytes;
}

static void put_escaped(iwn_out_t *self, const char *text) {
    put(self, "\"", 1U);
    while (*text != '\0') {
        text += put_character(self, text);
    }
    put(self, "\"", 1U);
}

static void begin(iwn_out_t *self, const char *name) {
    if (self->comma) {
        put(self, ",", 1U);
    }
    self->comma = true;
    if (name != NULL) {
        put_escaped(self, name);
        put(self, ":", 1U);
    }
}

void iwn_out_init(iwn_out_t *self, char *data, size_t size) {
    *self = (iwn_out_t){.data = data, .size = size};
}

void iwn_out_open(iwn_out_t *self, const char *name, char bracket) {
    begin(self, name);
    put(self, &bracket, 1U);
    self->comma = false;
}

void iwn_out_close(iwn_out_t *self, char bracket) {
    put(self, &bracket, 1U);
    self->comma = true;
}

void iwn_out_int(iwn_out_t *self, const char *name, int64_t value) {
    char digits[24];
    (void)snprintf(digits, sizeof digits, "%" PRId64, value);
    begin(self, name);
    put_text(self, digits);
}

void iwn_out_bool(iwn_out_t *self, const char *name, bool value) {
    begin(self, name);
    put_text(self, value ? "true" : "false");
}

void iwn_out_null(iwn_out_t *self, const char *name) {
    begin(self, name);
    put_text(self, "null");
}

void iwn_out_known(iwn_out_t *self, const char *name, bool known, int64_t value) {
    if (known) {
        iwn_out_int(self, name, value);
    } else {
        iwn_out_null(self, name);
    }
}

void iwn_out_text(iwn_out_t *self, const char *name, const char *text) {
    if (text == NULL) {
        iwn_out_null(self, name);
        return;
    }
    begin(self, name);
    put_escaped(self, text);
}

size_t iwn_out_finish(iwn_out_t *self) {
    put(self, "\n", 1U);
    return self->overflow ? 0U : self->length;
}

void iwn_out_frame(const iw_can_frame_t *frame, iw_time_us_t at_us, iwn_out_t *json) {
    const bool extended = (frame->id & IW_CAN_EXTENDED) != 0U;
    char data[2U * IW_CAN_DATA_MAX + 1U] = "";
    for (size_t i = 0; i < frame->dlc && i < IW_CAN_DATA_MAX; ++i) {
        (void)snprintf(&data[2U * i], 3U, "%02X", frame->data[i]);
    }
    iwn_out_int(json, "t_us", (int64_t)at_us);
    iwn_out_int(json, "id", frame->id & (extended ? EXTENDED_ID_MASK : IW_CAN_ID_MASK));
    iwn_out_int(json, "dlc", frame->dlc);
    iwn_out_text(json, "data", data);
    iwn_out_text(json, "kind", frame->kind == (uint8_t)IW_CAN_ECHO ? "echo" : "received");
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
