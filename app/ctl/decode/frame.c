// SPDX-License-Identifier: MIT
#include "frame.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *frame_direction(const candump_t *frame) {
    return (frame->mark == CANDUMP_SENT) ? "T" : (frame->mark == CANDUMP_RECEIVED) ? "R" : "";
}

void frame_add_id(const candump_t *frame, iwn_text_t *line) {
    iwn_text_hex(line, frame->id, (frame->extended || frame->id > IW_CAN_ID_MASK) ? 8U : 3U);
}

void frame_add_bytes(const candump_t *frame, const char *gap, iwn_text_t *line) {
    for (size_t i = 0; i < frame->length && !frame->remote; i++) {
        iwn_text_add(line, (i > 0U) ? gap : "");
        iwn_text_hex(line, frame->data[i], 2U);
    }
}

/// Returns the blanks that fill a text up to `columns`, which is at most 12.
static const char *fill(const char *text, size_t columns) {
    static const char blanks[] = "            ";
    const size_t length = strlen(text);
    return &blanks[sizeof blanks - 1U - ((length < columns) ? columns - length : 0U)];
}

void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded) {
    char text[FRAME_LINE_SIZE];
    char digits[IWN_DIGITS_MAX + 1U] = "";
    const char *const id = iwn_digits(frame->id, &digits[IWN_DIGITS_MAX]);
    const bool noted = decoded->note[0] != '\0';
    iwn_text_t line = iwn_text_begin(text, sizeof text);
    IWN_TEXT_JOIN(&line, fill(time_text, 12U), time_text, "  ", fill(id, 4U), id, " (0x");
    frame_add_id(frame, &line);
    IWN_TEXT_JOIN(&line, (frame->mark == CANDUMP_SENT) ? ") T " : ")   ", decoded->wheel, fill(decoded->wheel, 6U),
                  decoded->message, fill(decoded->message, 8U), "  ");
    if (decoded->present != 0U) {
        field_add_all(decoded, &line);
    } else {
        IWN_TEXT_JOIN(&line, frame->remote ? "remote, " : "", frame->fd ? "CAN FD, " : "");
        iwn_text_int(&line, frame->length);
        IWN_TEXT_JOIN(&line, (frame->length == 1U) ? " byte" : " bytes",
                      (frame->length > 0U && !frame->remote) ? ": " : "");
        frame_add_bytes(frame, " ", &line);
    }
    IWN_TEXT_JOIN(&line, noted ? " (" : "", decoded->note, noted ? ")\n" : "\n");
    (void)fwrite(text, 1, line.length, stdout);
}

/// Reads hexadecimal text into bytes. Returns their number.
static uint8_t take_data(const char *text, uint8_t data[IW_CAN_DATA_MAX]) {
    uint8_t length = 0;
    while (text != NULL && length < IW_CAN_DATA_MAX && text[0] != '\0' && text[1] != '\0') {
        const char pair[] = {text[0], text[1], '\0'};
        data[length++] = (uint8_t)strtoul(pair, NULL, 16);
        text += 2;
    }
    return length;
}

static bool has_flag(const json_t *told, const char *wanted) {
    const json_t *flags = json_object_get(told, "flags");
    for (size_t i = 0; i < json_array_size(flags); i++) {
        const char *flag = json_string_value(json_array_get(flags, i));
        if (flag != NULL && strcmp(flag, wanted) == 0) {
            return true;
        }
    }
    return false;
}

candump_t frame_from_json(const json_t *told, int64_t *out_at_us) {
    const char *kind = json_string_value(json_object_get(told, "kind"));
    candump_t frame = {.id = (uint32_t)json_integer_value(json_object_get(told, "id")) & CANDUMP_ID_MASK,
                       .mark = (kind != NULL && strcmp(kind, "echo") == 0) ? CANDUMP_SENT : CANDUMP_RECEIVED,
                       .extended = has_flag(told, "extended"),
                       .remote = has_flag(told, "remote"),
                       .fd = has_flag(told, "fd")};
    frame.length = take_data(json_string_value(json_object_get(told, "data")), frame.data);
    *out_at_us = json_integer_value(json_object_get(told, "t_us"));
    return frame;
}
