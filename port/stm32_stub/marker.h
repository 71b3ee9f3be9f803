// SPDX-License-Identifier: MIT
/// Were we sending when the last run ended? A word that survives a reset, but not a power-off.
///
/// It outlives any number of resets: only zeros that were acknowledged clear it, since only then the wheels do not keep
/// an older command.
#ifndef BRD_MARKER_H
#define BRD_MARKER_H

#include "iwheel/snapshot.h"

/// True if a run before this start was sending setpoints and no run has ended that: the wheels would keep the last
/// command for their full second. Ask once, before `brd_marker_step`. `power_on`: RAM holds nothing of such a run.
bool brd_marker_take(bool power_on);

/// After each step of the gateway. Sets the marker while setpoints are sent; clears it in the silence after a hold in
/// which zeros for both wheels were acknowledged.
void brd_marker_step(const iw_snapshot_t *seen);

#endif
