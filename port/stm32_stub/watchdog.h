// SPDX-License-Identifier: MIT
/// The independent watchdog: its own oscillator, never to be stopped again. Fed by a complete cycle of the main loop,
/// before that loop by a complete attempt to start the crystal (nothing can be sent yet), and by nothing else.
#ifndef IW_STM32_WATCHDOG_H
#define IW_STM32_WATCHDOG_H

/// It resets the chip unless fed at least every this many milliseconds, however fast its oscillator.
#define IW_WATCHDOG_MS 60U

void iw_watchdog_start(void);
void iw_watchdog_feed(void);

#endif
