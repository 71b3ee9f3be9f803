// SPDX-License-Identifier: MIT
/// Rules of the pair in a step of the gateway: the comparison with its conditions and reaction, and common silence.
#ifndef IW_WATCH_PAIR_H
#define IW_WATCH_PAIR_H

#include "iwheel/types.h"

struct iw_gateway;

/// Returns the last measured speed in the machine's frame and in the unit of setpoints (at IW_SETPOINT_RADIUS_MM).
int32_t iw_watch_own_mm_s(const struct iw_gateway *self, size_t side);

/// Compares the pair. `applied`: the present pair. `online`: both wheels are online. The deviation restarts from zero
/// while no setpoint is sent, while zeros are sent, after zero without ramp (the wheels then roll or brake on their
/// own), and while a wheel is reported as lost. It does not change while a late step alone makes a wheel offline.
void iw_watch_pair(struct iw_gateway *self, const iw_pair_t *applied, bool online);

/// Returns the time at which both wheels are offline if neither sends another speed message.
iw_time_us_t iw_watch_both_offline_us(const struct iw_gateway *self);

/// Excuses both wheels in a stalled step: their silence counts from now. A wheel that was lost before the stall remains
/// lost.
void iw_watch_excuse(struct iw_gateway *self);

#endif
