// SPDX-License-Identifier: MIT
/// E-stop input: level and edges on EXTI line 0. See pins.h for the contact.
#ifndef BRD_ESTOP_H
#define BRD_ESTOP_H

#include "iwheel/types.h"

/// Call it after `brd_pins_init`. Edges count from then on.
void brd_estop_init(void);

/// Implements `estop_pressed` of the HAL. Returns 1 while the contact is open, and once after any edge since the last
/// call, however short the pulse; otherwise 0. `context` is not used, because there is one e-stop.
int brd_estop_pressed(void *context);

/// Handler of the line's interrupt. It wakes the main loop.
void brd_estop_on_edge(void);

#endif
