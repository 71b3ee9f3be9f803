// SPDX-License-Identifier: MIT
/// Board with an STM32F405 or F407 and a crystal of 8 MHz (STM32F4DISCOVERY: UM1472).
///
/// A board consists of this header and `memory.ld` next to it; the files of the family do the rest. To add another
/// board of the same family, copy this folder, change the differences, and select it with -DIWHEEL_BOARD. A clock that
/// cannot produce the exact bit rate does not compile.
#ifndef BRD_BOARD_H
#define BRD_BOARD_H

#define BRD_NAME     "STM32F407 (Discovery)"
#define BRD_LAMP     BRD_PIN_D(12U) ///< LD4, green (UM1472). PA5 is the clock of the motion sensor.
#define BRD_LAMP_LIT 1              ///< Level that switches it on.
/// Revision A does not support prefetch, and its device identifier is wrong too (ES0182), so no revision uses it: the
/// caches of the flash do most of its work.
#define BRD_CAN_PREFETCH 0

#include "board_f4.h"

#endif
