// SPDX-License-Identifier: MIT
/// Functions of your board for main.c. board_pretend.c implements them for an emulated Cortex-M4; port/stm32_stub is a
/// real board.
#ifndef BOARD_H
#define BOARD_H

#include "iwheel/hal.h"

/// Starts the clocks, CAN at 1 Mbit/s and 62.5 %, and the e-stop's pin. Does not return if one of them fails.
void board_start(void);

/// Returns the microseconds since any fixed instant. They never decrease.
iw_time_us_t board_time_us(void);

/// Returns the five functions of hal.h.
iw_hal_t board_hal(void);

/// Returns true if the run before this one ended while it was sending (a word in RAM that survives the reset).
bool board_restarted(void);

/// Feeds the watchdog. Call it only after each complete step.
void board_watchdog_feed(void);

/// Waits until that time, or until a frame, an echo or an edge of the e-stop arrives.
void board_sleep_until(iw_time_us_t until_us);

#endif
