// SPDX-License-Identifier: MIT
/// Bus controller of the board: the one interface of this port for bxCAN (can_bxcan.c, bxcan.c) and FDCAN
/// (can_fdcan.c, fdcan.c). The build links one of them.
///
/// The core sees no difference. The controllers differ in the frames that they can purge, and in a few details:
///
/// |                           | bxCAN                                   | FDCAN                              |
/// |---------------------------|-----------------------------------------|------------------------------------|
/// | one waiting frame         | is aborted alone                        | is cancelled alone                 |
/// | a frame on the bus        | ends first (160 us); it is not repeated | the same                           |
/// | a cancelled frame         | never reaches the bus later             | the same                           |
/// | a cancellation that hangs | the driver resets the controller        | the same; all FDCANs of the chip   |
/// | the two frames of a pair  | two writes: a reset of the CPU between  | one write: both or none            |
/// |                           | both leaves the left frame alone        |                                    |
/// | frames at bus-off         | are aborted before the bus is joined    | the initialisation drops them      |
/// | end of bus-off            | after 128 times 11 recessive bits       | after 129 times 11 recessive bits  |
/// | a full receive FIFO       | loses an older frame                    | loses the new frame                |
/// | an FD frame of others     | is destroyed by an error frame          | is ignored, counted and reported   |
///
/// Neither has a queue behind the three buffers, so nothing else must be purged.
#ifndef BRD_CAN_H
#define BRD_CAN_H

#include "iwheel/hal.h"

/// Functions of the HAL: those of the bus, and brd_estop_pressed.
extern const iw_hal_t brd_can_hal;

/// Initialises the controller and enables its interrupts, which wake the main loop. Call it once, with the clock of
/// board.h and after `brd_pins_init`. `silent`: the controller never acknowledges, and `send` always fails.
void brd_can_start(bool silent);

#endif
