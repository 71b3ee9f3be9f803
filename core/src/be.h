// SPDX-License-Identifier: MIT
/// Big-endian words by shifts. The compiler replaces them by a load and a byte swap if the CPU has one.
#ifndef IW_BE_H
#define IW_BE_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

/// Forces inlining and states the alignment. Compilers estimate the size before they replace the shifts, and would not
/// inline the function. They also do not know that the data of a frame are aligned to four bytes.
#ifdef __GNUC__
#define IW_BE_INLINE         __attribute__((always_inline)) static inline
#define IW_BE_ALIGNED(bytes) (__builtin_assume_aligned((bytes), 4))
#else
#define IW_BE_INLINE         static inline
#define IW_BE_ALIGNED(bytes) (bytes)
#endif

/// gcc replaces the shifts below by a load and a swap. clang would split them into halves and need two of each, so it
/// gets the builtin.
#if defined(__clang__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define IW_BE_SWAP(word) (__builtin_bswap32(word))
#endif

/// Reads bytes 0-3 of the data, or bytes 4-7 if `index` is 1.
IW_BE_INLINE uint32_t iw_be_word(const iw_can_frame_t *frame, size_t index) {
    const uint8_t *const bytes = (const uint8_t *)IW_BE_ALIGNED(&frame->data[(size_t)4 * index]);
#ifdef IW_BE_SWAP
    uint32_t word;
    __builtin_memcpy(&word, bytes, sizeof word);
    return IW_BE_SWAP(word);
#else
    return ((uint32_t)bytes[0] << 24) | ((uint32_t)bytes[1] << 16) | ((uint32_t)bytes[2] << 8) | bytes[3];
#endif
}

IW_BE_INLINE void iw_be_put_word(iw_can_frame_t *frame, size_t index, uint32_t word) {
    uint8_t *const bytes = (uint8_t *)IW_BE_ALIGNED(&frame->data[(size_t)4 * index]);
#ifdef IW_BE_SWAP
    const uint32_t swapped = IW_BE_SWAP(word);
    __builtin_memcpy(bytes, &swapped, sizeof swapped);
#else
    bytes[0] = (uint8_t)(word >> 24);
    bytes[1] = (uint8_t)((word >> 16) & 0xFFU);
    bytes[2] = (uint8_t)((word >> 8) & 0xFFU);
    bytes[3] = (uint8_t)(word & 0xFFU);
#endif
}

/// Returns the lower 16 bits as two's complement. C leaves this conversion to the compiler; all supported compilers do
/// it.
IW_BE_INLINE int16_t iw_be_low_i16(uint32_t word) {
    return (int16_t)(uint16_t)(word & 0xFFFFU);
}

/// Combines two 16-bit values, the first one in the upper half.
IW_BE_INLINE uint32_t iw_be_join(int16_t first, int16_t second) {
    return ((uint32_t)(uint16_t)first << 16) | (uint16_t)second;
}

#endif
