// SPDX-License-Identifier: MIT
/// Marker that the last run was sending when it ended: a word in RAM that survives a reset and mostly a brown-out, but
/// not a power-off.
///
/// It survives any number of resets. Only acknowledged zeros clear it, because only then the wheels do not execute an
/// older command.
#ifndef BRD_MARKER_H
#define BRD_MARKER_H

#include "iwheel/snapshot.h"

/// Returns true if a run before this start was sending setpoints and no run has ended that: the wheels would then
/// execute the last command for its full second. Call it once, before `brd_marker_step`.
bool brd_marker_take(void);

/// Call it after each step of the gateway. Sets the marker while setpoints are sent. Clears it when nothing is sent
/// after a hold in which both wheels acknowledged zeros.
void brd_marker_step(const iw_snapshot_t *seen);

#endif
