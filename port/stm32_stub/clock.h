// SPDX-License-Identifier: MIT
/// The clock tree of the board: crystal, PLL, bus dividers, flash wait states.
#ifndef IW_STM32_CLOCK_H
#define IW_STM32_CLOCK_H

#include "iwheel/types.h"

/// Tries to run the core from the crystal: IW_BOARD_CORE_HZ and IW_BOARD_APB1_HZ. False if crystal or PLL are not up
/// within a few milliseconds; the core is then on the internal oscillator, the crystal goes on starting, and the call
/// may be repeated: also a slow crystal starts at last. Once true, a failure of the crystal raises the NMI.
bool iw_clock_start(void);

/// True if this start is a power-on: RAM holds nothing of the run before. Ask once; the flags are cleared for the next
/// start.
bool iw_clock_was_power_on(void);

/// For clock.c, by one file per family: sets wait states, dividers and the PLL, which is off yet, for IW_BOARD_CORE_HZ.
/// False if the chip does not take it.
bool iw_clock_prepare(void);

/// For these files. Every wait on a flag is bounded: a crystal that is broken must end in a message, not in a dead
/// loop.
bool iw_clock_wait_for(const volatile uint32_t *flags, uint32_t mask, uint32_t value);

#endif
