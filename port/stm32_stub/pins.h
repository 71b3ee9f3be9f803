// SPDX-License-Identifier: MIT
/// The pins of the board, which board_pins.h and the board's header name. One file per family implements it.
#ifndef BRD_PINS_H
#define BRD_PINS_H

#include "board.h"
#include "iwheel/types.h"

#include <assert.h>

static_assert(BRD_ESTOP % 16U == 0U,
              "the e-stop's interrupt is EXTI line 0: take pin 0 of a port (PA0, PB0, PC0 or PD0)");

/// Clocks the ports, the bus controller and the serial port, sets pull-ups and functions, and connects EXTI line 0 to
/// the e-stop's pin. Works on any clock.
void brd_pins_init(void);

/// The level of the e-stop's pin. High: the contact is open or its wire is cut, which is pressed.
bool brd_pins_estop_high(void);

/// The level of the start and reset button's pin. Low: pressed.
bool brd_pins_button_low(void);

void brd_pins_lamp(bool lit);

#endif
