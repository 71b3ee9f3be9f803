// SPDX-License-Identifier: MIT
/// An STM32F446 with a crystal of 8 MHz, or as Nucleo-F446RE with 8 MHz from its debugger (-DIWHEEL_CLOCK_INPUT=ON;
/// UM1724).
///
/// A board is this header and `memory.ld` beside it; the family's files do the rest. To make another board of the same
/// family copy this folder, change what differs, and name it with -DIWHEEL_BOARD; a clock that cannot give the bus
/// exactly does not compile.
#ifndef BRD_BOARD_H
#define BRD_BOARD_H

#define BRD_NAME     "STM32F446 (Nucleo)"
#define BRD_LAMP     BRD_PIN_A(5U) ///< LD2 (UM1724).
#define BRD_LAMP_LIT 1             ///< The level that lights it.

#include "board_f4.h"

#endif
