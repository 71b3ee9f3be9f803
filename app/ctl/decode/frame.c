// SPDX-License-Identifier: MIT
#include "frame.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *frame_direction(const candump_t *frame) {
    return (frame->mark == CANDUMP_SENT) ? "T" : (frame->mark == CANDUMP_RECEIVED) ? "R" : "";
}

void frame_add_bytes(const candump_t *frame, const char *gap, iwn_text_t *line) {
    for (size_t i = 0; i < frame->length && !frame->remote; i++) {
        iwn_text_add(line, (i > 0U) ? gap : "");
        iwn_text_hex(line, frame->data[i], 2U);
    }
}

void frame_add_id(const candump_t *frame, iwn_text_t *line) {
    unsigned digits = frame->extended ? 8U : 3U;
    while (digits < 8U && frame->id >> 4U * digits != 0U) { // An error report may have more than a standard id.
        digits++;
    }
    iwn_text_add(line, "0x");
    iwn_text_hex(line, frame->id, digits);
}

/// Appends the number of bytes, and the bytes.
static void add_length(const candump_t *frame, iwn_text_t *line) {
    IWN_TEXT_JOIN(line, frame->remote ? "remote, " : "", frame->fd ? "CAN FD, " : "");
    iwn_text_int(line, frame->length);
    iwn_text_add(line, (frame->length == 1U) ? " byte" : " bytes");
    if (frame->length > 0U && !frame->remote) {
        iwn_text_add(line, ": ");
        frame_add_bytes(frame, " ", line);
    }
}

/// Appends a text with spaces before it (`right`) or behind it.
static void add_cell(const char *text, size_t columns, bool right, iwn_text_t *line) {
    static const char blanks[] = "            ";
    const size_t length = strlen(text);
    const size_t gap = (length < columns) ? columns - length : 0U;
    iwn_text_span(line, blanks, right ? gap : 0U);
    iwn_text_span(line, text, length);
    iwn_text_span(line, blanks, right ? 0U : gap);
}

void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded) {
    char text[FRAME_LINE_SIZE];
    char number[IWN_DIGITS_MAX + 1U];
    iwn_text_t line = iwn_text_begin(text, sizeof text);
    iwn_text_t id = iwn_text_begin(number, sizeof number);
    iwn_text_int(&id, frame->id);
    add_cell(time_text, 12U, true, &line);
    iwn_text_add(&line, "  ");
    add_cell(number, 4U, true, &line);
    iwn_text_add(&line, " (");
    frame_add_id(frame, &line);
    iwn_text_add(&line, (frame->mark == CANDUMP_SENT) ? ") T " : ")   ");
    add_cell(decoded->wheel, 6U, false, &line);
    add_cell(decoded->message, 10U, false, &line);
    if (decoded->present != 0U) {
        field_add_all(decoded, &line);
    } else {
        add_length(frame, &line);
    }
    if (decoded->note[0] != '\0') {
        IWN_TEXT_JOIN(&line, " (", decoded->note, ")");
    }
    iwn_text_span(&line, "\n", 1U);
    (void)fwrite(text, 1, line.length, stdout);
}

/// Reads hexadecimal text into bytes. Returns their number.
static uint8_t read_data(const char *text, uint8_t data[IW_CAN_DATA_MAX]) {
    uint8_t length = 0;
    while (text != NULL && length < IW_CAN_DATA_MAX && text[0] != '\0' && text[1] != '\0') {
        const char pair[] = {text[0], text[1], '\0'};
        data[length++] = (uint8_t)strtoul(pair, NULL, 16);
        text += 2;
    }
    return length;
}

static bool has_flag(const json_t *json, const char *wanted) {
    const json_t *flags = json_object_get(json, "flags");
    for (size_t i = 0; i < json_array_size(flags); i++) {
        const char *flag = json_string_value(json_array_get(flags, i));
        if (flag != NULL && strcmp(flag, wanted) == 0) {
            return true;
        }
    }
    return false;
}

candump_t frame_from_json(const json_t *json, int64_t *out_at_us) {
    const char *kind = json_string_value(json_object_get(json, "kind"));
    candump_t frame = {.id = (uint32_t)json_integer_value(json_object_get(json, "id")) & CANDUMP_ID_MASK,
                       .mark = (kind != NULL && strcmp(kind, "echo") == 0) ? CANDUMP_SENT : CANDUMP_RECEIVED,
                       .extended = has_flag(json, "extended"),
                       .remote = has_flag(json, "remote"),
                       .fd = has_flag(json, "fd")};
    frame.length = read_data(json_string_value(json_object_get(json, "data")), frame.data);
    *out_at_us = json_integer_value(json_object_get(json, "t_us"));
    return frame;
}
