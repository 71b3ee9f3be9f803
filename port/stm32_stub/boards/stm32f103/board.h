// SPDX-License-Identifier: MIT
/// An STM32F103x8 or xB with a crystal of 8 MHz ("Blue Pill" and its relatives).
///
/// A board is this header and `memory.ld` beside it; the family's files do the rest. To make another board of the same
/// family copy this folder, change what differs, and name it with -DIWHEEL_BOARD; a clock that cannot give the bus
/// exactly does not compile.
#ifndef BRD_BOARD_H
#define BRD_BOARD_H

#define BRD_NAME     "STM32F103 (Blue Pill)"
#define BRD_LAMP     BRD_PIN_C(13U) ///< The board's own.
#define BRD_LAMP_LIT 0              ///< The level that lights it.

#include "board_f1.h"

#endif
