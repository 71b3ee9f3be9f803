// SPDX-License-Identifier: MIT
/// Nucleo-G474RE, with the crystal of 24 MHz that is on it (UM2505).
///
/// A board consists of this header and `memory.ld` next to it; the files of the family do the rest. To add another
/// board of the same family, copy this folder, change the differences, and select it with -DIWHEEL_BOARD. A clock that
/// cannot produce the exact bit rate does not compile.
#ifndef BRD_BOARD_H
#define BRD_BOARD_H

#define BRD_NAME     "STM32G474 (Nucleo)"
#define BRD_LAMP     BRD_PIN_A(5U) ///< LD2 (UM2505).
#define BRD_LAMP_LIT 1             ///< Level that switches it on.

#include "board_g4.h"

#endif
