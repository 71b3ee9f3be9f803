// SPDX-License-Identifier: MIT
/// Board with an STM32F103x8 or xB and a crystal of 8 MHz ("Blue Pill" and similar).
///
/// A board consists of this header and `memory.ld` next to it; the files of the family do the rest. To add another
/// board of the same family, copy this folder, change the differences, and select it with -DIWHEEL_BOARD. A clock that
/// cannot produce the exact bit rate does not compile.
#ifndef BRD_BOARD_H
#define BRD_BOARD_H

#define BRD_NAME     "STM32F103 (Blue Pill)"
#define BRD_LAMP     BRD_PIN_C(13U) ///< Lamp on the board.
#define BRD_LAMP_LIT 0              ///< Level that switches it on.

#include "board_f1.h"

#endif
