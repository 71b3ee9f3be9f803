// SPDX-License-Identifier: MIT
/// Text to a terminal on USART2 (board_pins.h), 115200 baud 8N1. Nobody ever waits for it.
#ifndef BRD_CONSOLE_H
#define BRD_CONSOLE_H

#include "iwheel/types.h"

/// After `brd_pins_init`, and again after every change of the clock. What waits to be sent is kept.
void brd_console_start(uint32_t apb1_hz);

/// Appends to what waits. What does not fit, 511 characters in all, is left out.
void brd_console_text(const char *text);
void brd_console_number(uint32_t value);
void brd_console_hex(uint32_t value); ///< With 0x and eight digits.

/// Hands over one character if the last one has gone. True while there are more: call again within a millisecond, or
/// later.
bool brd_console_step(void);

/// True if a character came since the last call; which one does not matter.
bool brd_console_asked(void);

#endif
