// SPDX-License-Identifier: MIT
/// The e-stop input: level and edges of EXTI line 0. See pins.h for the contact.
#ifndef BRD_ESTOP_H
#define BRD_ESTOP_H

#include "iwheel/types.h"

/// After `brd_pins_init`. Edges count from here on.
void brd_estop_init(void);

/// The HAL's `estop_pressed`: 1 while the contact is open, and once for any edge since the last call, however short the
/// pulse. `context` is not used: there is one e-stop.
int brd_estop_pressed(void *context);

/// The interrupt of the line. Wakes the main loop.
void brd_estop_on_edge(void);

#endif
