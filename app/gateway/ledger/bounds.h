// SPDX-License-Identifier: MIT
/// What measuring can give. What was stored is held to the same: a file whose checksum is right can still hold what no
/// wheel has ever shown. Pure functions.
#ifndef GATEWAY_BOUNDS_H
#define GATEWAY_BOUNDS_H

#include "memory.h"

/// The furthest raw force in cN that is not saturated. The finer unit cannot say more, and both wheels are of one make: a
/// zero further off would leave no force to be measured.
#define GW_BOUNDS_ZERO_mN 327660

/// True if some run of the gateway could have found this: state, evidence, figure, values and time belong together.
bool gw_bounds_item(iw_ledger_item_t item, const gw_known_item_t *known);

/// True if a wheel could have sent this offset, or a quiet window given it.
bool gw_bounds_offset(const gw_known_offset_t *known);

#endif
