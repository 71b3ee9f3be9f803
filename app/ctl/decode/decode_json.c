// SPDX-License-Identifier: MIT
#include "decode_json.h"

#include "frame_line.h"

#include "text/text.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>

/// Text, or null if there is none or it is not UTF-8.
static json_t *text_or_null(const char *text) {
    json_t *value = (text[0] != '\0') ? json_string(text) : NULL;
    return (value != NULL) ? value : json_null();
}

static json_t *bytes_of(const candump_t *frame) {
    char data[2U * CANDUMP_DATA_MAX + 1U] = "";
    for (size_t i = 0; i < frame->length && !frame->remote; i++) {
        (void)snprintf(&data[2U * i], 3U, "%02X", frame->data[i]);
    }
    return json_string(data);
}

static json_t *values_of(const decoded_t *decoded) {
    json_t *values = json_object();
    for (unsigned field = 0; field < FIELDS; field++) {
        if ((decoded->present & (1U << field)) != 0U) {
            (void)json_object_set_new(values, field_column((field_t)field), json_integer(decoded->value[field]));
        }
    }
    return values;
}

bool decode_print_json(const candump_t *frame, const decoded_t *decoded) {
    json_t *line = json_pack(
        "{s:I, s:o, s:o, s:I, s:b, s:b, s:b, s:i, s:o, s:o, s:s, s:o, s:o}", "t_us", (json_int_t)frame->time_us,
        "interface", text_or_null(frame->interface), "direction", text_or_null(frame_direction(frame)), "id",
        (json_int_t)frame->id, "extended", (int)frame->extended, "remote", (int)frame->remote, "fd", (int)frame->fd,
        "dlc", (int)frame->length, "data", bytes_of(frame), "wheel", text_or_null(decoded->wheel), "message",
        decoded->message, "values", values_of(decoded), "note", text_or_null(decoded->note));
    const bool written = line != NULL && text_json_value(line, stdout);
    json_decref(line);
    return written;
}
