// SPDX-License-Identifier: MIT
/// Private to the files of tell.h.
#ifndef IWHEEL_NORTHBOUND_TELL_FORCE_H
#define IWHEEL_NORTHBOUND_TELL_FORCE_H

#include "iwheel_northbound/tell.h"

/// The force of one wheel. `alone`: in an object of its own, whose names lack the prefix that they have among the wheel's other fields, and
/// without what the event `force` leaves to a status.
void iwn_tell_wheel_force(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iw_side_t side, bool alone,
                          iwn_out_t *json);

#endif
