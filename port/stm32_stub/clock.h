// SPDX-License-Identifier: MIT
/// The clock tree of the board: crystal, PLL, bus dividers, flash wait states. One file per family implements it.
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

#endif
