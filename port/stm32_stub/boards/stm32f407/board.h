// SPDX-License-Identifier: MIT
/// An STM32F405 or F407 with a crystal of 8 MHz (STM32F4DISCOVERY: UM1472).
///
/// A board is this header and `memory.ld` beside it; the family's files do the rest. To make another board of the same
/// family copy this folder, change what differs, and name it with -DIWHEEL_BOARD; a clock that cannot give the bus
/// exactly does not compile.
#ifndef BRD_BOARD_H
#define BRD_BOARD_H

#define BRD_NAME     "STM32F407 (Discovery)"
#define BRD_LAMP     BRD_PIN_D(12U) ///< LD4, the green one (UM1472). PA5 is the clock of its motion sensor.
#define BRD_LAMP_LIT 1              ///< The level that lights it.

#include "board_f4.h"

#endif
