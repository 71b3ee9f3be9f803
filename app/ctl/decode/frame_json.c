// SPDX-License-Identifier: MIT
#include "frame_json.h"

#include <stdlib.h>
#include <string.h>

/// Hexadecimal text as bytes.
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
