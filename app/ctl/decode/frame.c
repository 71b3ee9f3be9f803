// SPDX-License-Identifier: MIT
#include "frame.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *frame_direction(const candump_t *frame) {
    return (frame->mark == CANDUMP_SENT) ? "T" : (frame->mark == CANDUMP_RECEIVED) ? "R" : "";
}

void frame_print_bytes(const candump_t *frame, const char *gap) {
    for (size_t i = 0; i < frame->length && !frame->remote; i++) {
        (void)printf("%s%02X", (i > 0U) ? gap : "", frame->data[i]);
    }
}

void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded) {
    (void)printf("%12s  %4" PRIu32 " (0x%0*" PRIX32 ")%-2s %-5s %-8s  ", time_text, frame->id, frame->extended ? 8 : 3,
                 frame->id, (frame->mark == CANDUMP_SENT) ? " T" : "", decoded->wheel, decoded->message);
    if (decoded->present != 0U) {
        field_print_all(decoded, stdout);
    } else {
        (void)printf("%s%s%u byte%s%s", frame->remote ? "remote, " : "", frame->fd ? "CAN FD, " : "", frame->length,
                     (frame->length == 1U) ? "" : "s", (frame->length > 0U && !frame->remote) ? ": " : "");
        frame_print_bytes(frame, " ");
    }
    (void)printf("%s%s%s\n", (decoded->note[0] != '\0') ? " (" : "", decoded->note,
                 (decoded->note[0] != '\0') ? ")" : "");
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
