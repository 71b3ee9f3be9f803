// SPDX-License-Identifier: MIT
/// Helpers of several files: absolute value, order and age of times, and a compiler attribute.
#ifndef IW_ARITHMETIC_H
#define IW_ARITHMETIC_H

#include "iwheel/types.h"

/// Prevents inlining. Compilers inline short functions at every call, even if that makes the code larger.
#ifdef __GNUC__
#define IW_APART __attribute__((noinline))
#else
#define IW_APART
#endif

/// Returns |value|. The caller guarantees that it is not INT32_MIN.
static inline int32_t iw_abs(int32_t value) {
    return (value < 0) ? -value : value;
}

static inline iw_time_us_t iw_sooner(iw_time_us_t a_us, iw_time_us_t b_us) {
    return (a_us < b_us) ? a_us : b_us;
}

static inline iw_time_us_t iw_later(iw_time_us_t a_us, iw_time_us_t b_us) {
    return (a_us > b_us) ? a_us : b_us;
}

/// Returns the age of `then_us`; UINT32_MAX if it is older than 71 minutes, IW_NEVER, or in the future. All limits of
/// the core are shorter, so that 32 bits suffice.
uint32_t iw_age_us(iw_time_us_t then_us, iw_time_us_t now_us);

#endif
