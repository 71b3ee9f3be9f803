// SPDX-License-Identifier: MIT
/// A number that names this start of the board: no other start, of this board or of another, has the same.
#ifndef BRD_BOOT_H
#define BRD_BOOT_H

#include "iwheel/types.h"

/// The same for the whole run. `power_ons`: how many there were, this one among them; starts since then are counted
/// here.
uint64_t brd_boot_id(uint32_t power_ons);

#endif
