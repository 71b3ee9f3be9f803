// SPDX-License-Identifier: MIT
/// Bus controller of the board, for the main loop: the one interface of this port, whatever the controller is.
#ifndef BRD_CAN_H
#define BRD_CAN_H

#include "iwheel/hal.h"

/// Functions of the HAL: those of the bus, and brd_estop_pressed.
extern const iw_hal_t brd_can_hal;

/// Initialises the controller and enables its interrupts, which wake the main loop. Call it once, with the clock of
/// board.h and after `brd_pins_init`. `silent`: the controller never acknowledges, and `send` always fails.
void brd_can_start(bool silent);

#endif
