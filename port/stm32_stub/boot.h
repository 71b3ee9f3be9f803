// SPDX-License-Identifier: MIT
/// Identifier of this start of the board: no other start, of this board or of another, has the same one.
#ifndef BRD_BOOT_H
#define BRD_BOOT_H

#include "iwheel/types.h"

/// Returns the identifier, the same for the whole run. `power_ons` is the number of power-ons, including the last one;
/// this module counts the starts since then.
uint64_t brd_boot_id(uint32_t power_ons);

#endif
