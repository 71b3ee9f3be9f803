// SPDX-License-Identifier: MIT
/// An STM32F405 or F407 with a crystal of 8 MHz (Discovery boards).
///
/// A board is this header and `memory.ld` beside it; the family's files do the rest. To make another board of the same family copy
/// this folder, change what differs, and name it with -DIWHEEL_BOARD; a clock that cannot give the bus exactly does not compile.
///
/// | pin  | is                                                             |
/// |------|----------------------------------------------------------------|
/// | PA0  | e-stop: normally closed contact to ground; open is pressed     |
/// | PA1  | start and reset: normally open button to ground (demo only)    |
/// | PA5  | lamp, lit by a high level; see lamp.h                          |
/// | PA11 | CAN1 receive, from the transceiver                             |
/// | PA12 | CAN1 transmit, to the transceiver                              |
#ifndef IW_STM32_BOARD_H
#define IW_STM32_BOARD_H

#include "board_f4.h" // With another crystal: its lines here, changed.

#endif
