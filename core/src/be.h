// SPDX-License-Identifier: MIT
/// Big-endian integers by shifts, private to the core.
#ifndef IW_BE_H
#define IW_BE_H

#include <stdint.h>

/// Two's complement of 16 bits, without relying on the implementation's conversion.
static inline int16_t iw_be_get_i16(const uint8_t *bytes) {
    const uint32_t word = ((uint32_t)bytes[0] << 8) | bytes[1];
    return (int16_t)((int32_t)(word ^ 0x8000U) - 0x8000);
}

static inline int32_t iw_be_get_i32(const uint8_t *bytes) {
    return (int32_t)iw_be_get_i16(bytes) * 65536 + (int32_t)(((uint32_t)bytes[2] << 8) | bytes[3]);
}

static inline void iw_be_put_i16(uint8_t *bytes, int16_t value) {
    const uint16_t word = (uint16_t)value;
    bytes[0] = (uint8_t)(word >> 8);
    bytes[1] = (uint8_t)(word & 0xFFU);
}

static inline void iw_be_put_i32(uint8_t *bytes, int32_t value) {
    const uint32_t word = (uint32_t)value;
    bytes[0] = (uint8_t)(word >> 24);
    bytes[1] = (uint8_t)((word >> 16) & 0xFFU);
    bytes[2] = (uint8_t)((word >> 8) & 0xFFU);
    bytes[3] = (uint8_t)(word & 0xFFU);
}

#endif
