// SPDX-License-Identifier: MIT
/// The pins of the board. One file per family implements it; the board's header has the table.
#ifndef IW_STM32_PINS_H
#define IW_STM32_PINS_H

#include "iwheel/types.h"

/// Clocks the ports and the bus controller, sets pull-ups and functions, and connects EXTI line 0 to the e-stop's pin. Works on any clock.
void iw_pins_init(void);

/// The level of the e-stop's pin. High: the contact is open or its wire is cut, which is pressed.
bool iw_pins_estop_high(void);

/// The level of the start and reset button's pin. Low: pressed.
bool iw_pins_button_low(void);

void iw_pins_lamp(bool lit);

#endif
