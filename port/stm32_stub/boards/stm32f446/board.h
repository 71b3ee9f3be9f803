// SPDX-License-Identifier: MIT
/// Board with an STM32F446 and a crystal of 8 MHz, or a Nucleo-F446RE with 8 MHz from its debugger
/// (-DIWHEEL_CLOCK_INPUT=ON; UM1724).
///
/// A board consists of this header and `memory.ld` next to it; the files of the family do the rest. To add another
/// board of the same family, copy this folder, change the differences, and select it with -DIWHEEL_BOARD. A clock that
/// cannot produce the exact bit rate does not compile.
#ifndef BRD_BOARD_H
#define BRD_BOARD_H

#define BRD_NAME     "STM32F446 (Nucleo)"
#define BRD_LAMP     BRD_PIN_A(5U) ///< LD2 (UM1724).
#define BRD_LAMP_LIT 1             ///< Level that switches it on.

#define BRD_CAN_PREFETCH 1 ///< Of the flash.

#include "board_f4.h"

#endif
