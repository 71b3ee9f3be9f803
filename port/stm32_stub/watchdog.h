// SPDX-License-Identifier: MIT
/// Independent watchdog with its own oscillator; it cannot be stopped. A complete cycle of the main loop feeds it.
/// Before that loop, when nothing can be sent yet, a complete attempt to start the crystal feeds it. Nothing else does.
#ifndef BRD_WATCHDOG_H
#define BRD_WATCHDOG_H

/// The longest time in milliseconds between two feeds that never resets the chip, even with the fastest oscillator.
#define BRD_WATCHDOG_MS 60U

void brd_watchdog_start(void);
void brd_watchdog_feed(void);

/// Extends the period of a watchdog that runs since the reset to 22 s at least, until `brd_watchdog_start`.
void brd_watchdog_extend(void);

#endif
