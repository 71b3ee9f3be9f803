// SPDX-License-Identifier: MIT
/// The lamp shows the state: a pattern of 16 slots of 62.5 ms, repeated every second.
///
/// | lamp                  | state                                                        |
/// |-----------------------|--------------------------------------------------------------|
/// | one short flash       | listening                                                    |
/// | two short flashes     | listening, and the bus is down, off, or not joined yet       |
/// | three short flashes   | the crystal does not run: the board does not use the bus     |
/// | steady                | armed                                                        |
/// | fast, 8 Hz            | stopping                                                     |
/// | half on, half off     | e-stop pressed                                               |
/// | 2 Hz                  | latched, e-stop released: waits for reset                    |
/// | dark, or other        | no power, or no program                                      |
#ifndef BRD_LAMP_H
#define BRD_LAMP_H

#include "iwheel/snapshot.h"

#define BRD_LAMP_SLOT_US 62500U

#define BRD_LAMP_LISTENING  0x0001U
#define BRD_LAMP_NO_BUS     0x0005U
#define BRD_LAMP_NO_CRYSTAL 0x0015U
#define BRD_LAMP_ARMED      0xFFFFU
#define BRD_LAMP_STOPPING   0x5555U
#define BRD_LAMP_ESTOP      0x00FFU
#define BRD_LAMP_LATCHED    0x0F0FU

/// Returns the pattern for the state of the gateway. `estop_pressed` is the level of the contact.
uint16_t brd_lamp_pattern(const iw_snapshot_t *seen, bool estop_pressed);

bool brd_lamp_is_lit(uint16_t pattern, iw_time_us_t now_us);

#endif
