// SPDX-License-Identifier: MIT
/// The board: clock tree, time, e-stop contact, watchdog.
///
/// An STM32F103 with a crystal of 8 MHz. PA11/PA12: CAN transceiver. PB0: e-stop, a normally closed contact to ground, so that a
/// broken wire counts as pressed.
#ifndef IW_STM32_BOARD_H
#define IW_STM32_BOARD_H

#include "iwheel/types.h"

#define IW_STM32_CORE_HZ 64000000U
#define IW_STM32_APB1_HZ 32000000U

/// Starts crystal, PLL, time and pins. False if the crystal or the PLL does not come up within a bounded number of polls: the
/// internal oscillator is too inaccurate for 1 Mbit/s, so the bus must then be left alone.
bool iw_board_init(void);

/// True if the watchdog caused this start: the run before us may have been driving.
bool iw_board_was_reset_by_watchdog(void);

/// Microseconds since the start, monotonic. Not from an interrupt.
iw_time_us_t iw_board_now_us(void);

/// The HAL's `estop_pressed`. Edges are latched by the EXTI hardware, however short, without an interrupt.
int iw_board_estop_pressed(void *context);

/// From here on the chip resets unless fed at least every 67 ms (100 ms nominal; its oscillator has 30..60 kHz).
void iw_board_watchdog_start(void);
void iw_board_watchdog_feed(void);

#endif
