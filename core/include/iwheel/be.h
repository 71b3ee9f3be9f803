// SPDX-License-Identifier: MIT
/// Big-endian integers by shifts: the compiler makes a load and a swap of it where the CPU can.
#ifndef IW_BE_H
#define IW_BE_H

#include <stdint.h>

/// The lower 16 bits as two's complement. Through a union, because C leaves the conversion to the implementation.
static inline int16_t iw_be_low_i16(uint32_t word) {
    const union {
        uint16_t bits;
        int16_t value;
    } half = {(uint16_t)(word & 0xFFFFU)};
    return half.value;
}

static inline int16_t iw_be_get_i16(const uint8_t *bytes) {
    return iw_be_low_i16(((uint32_t)bytes[0] << 8) | bytes[1]);
}

static inline uint32_t iw_be_get_u32(const uint8_t *bytes) {
    return ((uint32_t)bytes[0] << 24) | ((uint32_t)bytes[1] << 16) | ((uint32_t)bytes[2] << 8) | bytes[3];
}

static inline int32_t iw_be_get_i32(const uint8_t *bytes) {
    const union {
        uint32_t bits;
        int32_t value;
    } word = {iw_be_get_u32(bytes)};
    return word.value;
}

static inline void iw_be_put_i16(uint8_t *bytes, int16_t value) {
    const uint16_t word = (uint16_t)value;
    bytes[0] = (uint8_t)(word >> 8);
    bytes[1] = (uint8_t)(word & 0xFFU);
}

static inline void iw_be_put_u32(uint8_t *bytes, uint32_t word) {
    bytes[0] = (uint8_t)(word >> 24);
    bytes[1] = (uint8_t)((word >> 16) & 0xFFU);
    bytes[2] = (uint8_t)((word >> 8) & 0xFFU);
    bytes[3] = (uint8_t)(word & 0xFFU);
}

static inline void iw_be_put_i32(uint8_t *bytes, int32_t value) {
    iw_be_put_u32(bytes, (uint32_t)value);
}

#endif
