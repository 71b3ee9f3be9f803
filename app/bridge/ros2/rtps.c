// SPDX-License-Identifier: MIT
#include "rtps.h"

#define PAD     0x01U
#define INFO_TS 0x09U

uint32_t rtps_read(const uint8_t *bytes, size_t count, bool little) {
    uint32_t value = 0;
    for (size_t i = 0; i < count; i++) {
        value |= (uint32_t)bytes[i] << (8U * (little ? i : count - 1U - i));
    }
    return value;
}

void rtps_write(uint32_t value, size_t count, bool little, uint8_t *out) {
    for (size_t i = 0; i < count; i++) {
        out[i] = (uint8_t)(value >> (8U * (little ? i : count - 1U - i)));
    }
}

int64_t rtps_read_sequence(const uint8_t *bytes, bool little) {
    return (int64_t)((uint64_t)rtps_read(bytes, 4, little) << 32 | rtps_read(bytes + 4, 4, little));
}

void rtps_write_sequence(int64_t number, bool little, uint8_t *out) {
    rtps_write((uint32_t)((uint64_t)number >> 32), 4, little, out);
    rtps_write((uint32_t)number, 4, little, out + 4);
}

bool rtps_part_at(const uint8_t *message, size_t length, size_t at, rtps_part_t *out) {
    *out = (rtps_part_t){.bytes = message + at};
    if (at + RTPS_SUBMESSAGE > length) {
        return false;
    }
    out->little = (out->bytes[1] & RTPS_LITTLE) != 0U;
    const size_t rest = rtps_read(out->bytes + 2, 2, out->little);
    const bool is_last = rest == 0U && out->bytes[0] != PAD && out->bytes[0] != INFO_TS; // Only these may be empty.
    out->size = is_last ? length - at : RTPS_SUBMESSAGE + rest;
    if (out->size > length - at) {
        out->size = 0;
        return false;
    }
    return true;
}
