// SPDX-License-Identifier: MIT
/// What several files share: a magnitude, an age, and a word to the compiler.
#ifndef IW_ARITHMETIC_H
#define IW_ARITHMETIC_H

#include "iwheel/types.h"

/// A function that is kept once: compilers put what is short wherever it is called, also where that makes more of it.
#ifdef __GNUC__
#define IW_APART __attribute__((noinline))
#else
#define IW_APART
#endif

/// |value| for values whose negation fits: everything here is far from INT32_MIN.
static inline int32_t iw_abs(int32_t value) {
    return (value < 0) ? -value : value;
}

/// How long ago `then_us` was; UINT32_MAX: longer than that (71 minutes), IW_NEVER, or not yet. Every limit of ours is
/// shorter, so that 32 bits judge it.
uint32_t iw_age_us(iw_time_us_t then_us, iw_time_us_t now_us);

#endif
