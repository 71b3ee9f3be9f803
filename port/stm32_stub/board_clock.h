// SPDX-License-Identifier: MIT
/// Clock tree of the board: crystal, PLL, bus dividers, flash wait states.
#ifndef BOARD_CLOCK_H
#define BOARD_CLOCK_H

#include "iwheel/types.h"

/// Tries to run the core from the crystal, with BRD_CORE_HZ and BRD_APB1_HZ. Returns false if crystal or PLL do not run
/// within a few milliseconds. The core then runs on the internal oscillator, the crystal continues to start, and the
/// caller may repeat the call: a slow crystal starts too. After the call has returned true, a failure of the crystal
/// raises the NMI.
bool brd_clock_start(void);

/// Returns true if this start is a power-on, after which RAM contains nothing of the previous run. Call it once: it
/// clears the flags for the next start.
bool brd_clock_was_power_on(void);

/// For board_clock.c; one file per family implements it. Sets wait states, dividers and the PLL, which is still off,
/// for BRD_CORE_HZ. Returns false if the chip does not accept them.
bool brd_clock_prepare(void);

/// For board_clock.c and the files of the families. Polls until the bits `mask` of `*flags` equal `value`. Returns
/// false after a limited number of polls, so that a defective crystal ends in a message and not in an endless loop.
bool brd_clock_wait_for(const volatile uint32_t *flags, uint32_t mask, uint32_t value);

#endif
