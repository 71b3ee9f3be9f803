// SPDX-License-Identifier: MIT
#include "frame.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CELL_MAX 12U

const char *frame_direction(const candump_t *frame) {
    return (frame->mark == CANDUMP_SENT) ? "T" : (frame->mark == CANDUMP_RECEIVED) ? "R" : "";
}

void frame_add_id(const candump_t *frame, iwn_text_t *line) {
    unsigned digits = frame->extended ? 8U : 3U;
    while (digits < 8U && frame->id >> 4U * digits != 0U) {
        digits++;
    }
    iwn_text_hex(line, frame->id, digits);
}

void frame_add_bytes(const candump_t *frame, const char *gap, iwn_text_t *line) {
    for (size_t i = 0; i < frame->length && !frame->remote; i++) {
        iwn_text_add(line, (i > 0U) ? gap : "");
        iwn_text_hex(line, frame->data[i], 2U);
    }
}

/// Padded to so many columns, at most CELL_MAX, on its right or on its left.
static void add_cell(iwn_text_t *line, const char *text, size_t columns, bool to_the_right) {
    static const char blanks[CELL_MAX + 1U] = "            ";
    const size_t length = strlen(text);
    const size_t gap = (length < columns) ? columns - length : 0U;
    iwn_text_span(line, blanks, to_the_right ? gap : 0U);
    iwn_text_span(line, text, length);
    iwn_text_span(line, blanks, to_the_right ? 0U : gap);
}

static void add_undecoded(iwn_text_t *line, const candump_t *frame) {
    IWN_TEXT_JOIN(line, frame->remote ? "remote, " : "", frame->fd ? "CAN FD, " : "");
    iwn_text_int(line, frame->length);
    IWN_TEXT_JOIN(line, (frame->length == 1U) ? " byte" : " bytes", (frame->length > 0U && !frame->remote) ? ": " : "");
    frame_add_bytes(frame, " ", line);
}

void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded) {
    char text[FRAME_LINE_SIZE];
    char id[IWN_DIGITS_MAX + 1U] = "";
    iwn_text_t line = iwn_text_begin(text, sizeof text);
    add_cell(&line, time_text, CELL_MAX, true);
    iwn_text_add(&line, "  ");
    add_cell(&line, iwn_digits(frame->id, &id[IWN_DIGITS_MAX]), 4U, true);
    iwn_text_add(&line, " (0x");
    frame_add_id(frame, &line);
    iwn_text_add(&line, (frame->mark == CANDUMP_SENT) ? ") T " : ")   ");
    add_cell(&line, decoded->wheel, 6U, false);
    add_cell(&line, decoded->message, 8U, false);
    iwn_text_add(&line, "  ");
    if (decoded->present != 0U) {
        field_add_all(decoded, &line);
    } else {
        add_undecoded(&line, frame);
    }
    if (decoded->note[0] != '\0') {
        IWN_TEXT_JOIN(&line, " (", decoded->note, ")");
    }
    iwn_text_add(&line, "\n");
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
