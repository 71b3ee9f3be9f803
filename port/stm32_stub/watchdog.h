// SPDX-License-Identifier: MIT
/// The independent watchdog: its own oscillator, never to be stopped again. Fed by a complete cycle of the main loop,
/// before that loop by a complete attempt to start the crystal (nothing can be sent yet), and by nothing else.
#ifndef BRD_WATCHDOG_H
#define BRD_WATCHDOG_H

/// It resets the chip unless fed at least every this many milliseconds, however fast its oscillator.
#define BRD_WATCHDOG_MS 60U

void brd_watchdog_start(void);
void brd_watchdog_feed(void);

#endif
