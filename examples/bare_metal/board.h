// SPDX-License-Identifier: MIT
/// What your board gives to main.c. board_pretend.c gives it for an emulated Cortex-M4; a real one is port/stm32_stub.
#ifndef BOARD_H
#define BOARD_H

#include "iwheel/hal.h"

/// Clocks, CAN at 1 Mbit/s and 62.5 %, the e-stop's pin. Never returns if one of them fails.
void board_start(void);

/// Microseconds since any instant, never back.
iw_time_us_t board_time_us(void);

/// The five functions of hal.h.
iw_hal_t board_hal(void);

/// True if the run before this one ended while it was sending (a word in RAM that survives the reset).
bool board_restarted(void);

/// Fed after each complete step, and nowhere else.
void board_watchdog_feed(void);

/// Until then, or until a frame, an echo or an edge of the e-stop comes.
void board_sleep_until(iw_time_us_t until_us);

#endif
