// SPDX-License-Identifier: MIT
/// Pins of the board, with the names from board_pins.h and the header of the board. One file per family implements it.
#ifndef BRD_PINS_H
#define BRD_PINS_H

#include "board.h"
#include "iwheel/types.h"

#include <assert.h>

static_assert(BRD_ESTOP % 16U == 0U,
              "the e-stop's interrupt is EXTI line 0: use pin 0 of a port (PA0, PB0, PC0 or PD0)");

/// Enables the clocks of the ports, the bus controller and the serial port, sets pull-ups and functions, and connects
/// EXTI line 0 to the pin of the e-stop. It works with any clock.
void brd_pins_init(void);

/// Returns true if the pin of the e-stop is high: the contact is open or its wire is cut, which counts as pressed.
bool brd_pins_estop_high(void);

/// Returns true if the pin of the start and reset button is low: the button is pressed.
bool brd_pins_button_low(void);

void brd_pins_lamp(bool lit);

#endif
