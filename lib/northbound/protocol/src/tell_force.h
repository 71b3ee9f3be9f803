// SPDX-License-Identifier: MIT
/// Private to tell.c: the fields about force of one wheel's object in a status.
#ifndef IWHEEL_NORTHBOUND_TELL_FORCE_H
#define IWHEEL_NORTHBOUND_TELL_FORCE_H

#include "iwheel_northbound/tell.h"

void iwn_tell_wheel_force(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iw_side_t side, iwn_out_t *json);

#endif
