// SPDX-License-Identifier: MIT
/// For the files of contents.h only.
#ifndef IWHEEL_NORTHBOUND_CONTENTS_FORCE_H
#define IWHEEL_NORTHBOUND_CONTENTS_FORCE_H

#include "iwheel_northbound/contents.h"

/// Writes the force of one wheel. `alone`: in a separate object, without the prefix of the names, and without the
/// fields that the event `force` does not have.
void iwn_write_wheel_force(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iw_side_t side, bool alone,
                           iwn_out_t *json);

#endif
