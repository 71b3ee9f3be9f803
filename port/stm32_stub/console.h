// SPDX-License-Identifier: MIT
/// Text output to a terminal on USART2 (board_pins.h), 115200 baud, 8N1. No function waits for the terminal.
#ifndef BRD_CONSOLE_H
#define BRD_CONSOLE_H

#include "iwheel/types.h"

/// Call it after `brd_pins_init`, and again after every change of the clock. Waiting characters are retained.
void brd_console_start(uint32_t apb1_hz);

/// Appends to the waiting characters. It drops characters that do not fit; 511 characters can wait.
void brd_console_text(const char *text);
void brd_console_number(uint32_t value);
void brd_console_hex(uint32_t value); ///< Writes 0x and eight digits.

/// Passes one character to the USART if the previous one has left. Returns true while more characters wait: call it
/// again after about a millisecond.
bool brd_console_step(void);

/// Returns true if a character was received since the last call; its value does not matter.
bool brd_console_asked(void);

#endif
