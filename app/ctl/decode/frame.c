// SPDX-License-Identifier: MIT
#include "frame.h"

#include <inttypes.h>
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

void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded) {
    char text[FRAME_LINE_SIZE];
    iwn_text_t values = iwn_text_begin(text, sizeof text);
    if (decoded->present != 0U) {
        field_add_all(decoded, &values);
    } else {
        IWN_TEXT_JOIN(&values, frame->remote ? "remote, " : "", frame->fd ? "CAN FD, " : "");
        iwn_text_int(&values, frame->length);
        IWN_TEXT_JOIN(&values, (frame->length == 1U) ? " byte" : " bytes",
                      (frame->length > 0U && !frame->remote) ? ": " : "");
        frame_add_bytes(frame, " ", &values);
    }
    if (decoded->note[0] != '\0') {
        IWN_TEXT_JOIN(&values, " (", decoded->note, ")");
    }
    (void)printf("%12s  %4" PRIu32 " (0x%0*" PRIX32 ")%-2s %-5s %-8s  %s\n", time_text, frame->id,
                 frame->extended ? 8 : 3, frame->id, (frame->mark == CANDUMP_SENT) ? " T" : "", decoded->wheel,
                 decoded->message, text);
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
