// SPDX-License-Identifier: MIT
/// The clock tree of the board: crystal, PLL, bus dividers, flash wait states.
#ifndef BOARD_CLOCK_H
#define BOARD_CLOCK_H

#include "iwheel/types.h"

/// Tries to run the core from the crystal: BRD_CORE_HZ and BRD_APB1_HZ. False if crystal or PLL are not up
/// within a few milliseconds; the core is then on the internal oscillator, the crystal goes on starting, and the call
/// may be repeated: also a slow crystal starts at last. Once true, a failure of the crystal raises the NMI.
bool brd_clock_start(void);

/// True if this start is a power-on: RAM holds nothing of the run before. Ask once; the flags are cleared for the next
/// start.
bool brd_clock_was_power_on(void);

/// For board_clock.c, by one file per family: sets wait states, dividers and the PLL, which is off yet, for
/// BRD_CORE_HZ. False if the chip does not take it.
bool brd_clock_prepare(void);

/// For these files. Every wait on a flag is bounded: a crystal that is broken must end in a message, not in a dead
/// loop.
bool brd_clock_wait_for(const volatile uint32_t *flags, uint32_t mask, uint32_t value);

#endif
