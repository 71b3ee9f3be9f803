// SPDX-License-Identifier: MIT
/// The rule of the pair in a step of the gateway: when both wheels are compared, and what follows.
#ifndef IW_WATCH_PAIR_H
#define IW_WATCH_PAIR_H

#include "iwheel/types.h"

struct iw_gateway;

/// The measured speed, of the last frame, in the machine's frame, in the unit of setpoints: at IW_SETPOINT_RADIUS_MM.
int32_t iw_watch_own_mm_s(const struct iw_gateway *self, size_t side);

/// `applied`: what the wheels are told now. `heard`: both wheels are. Nothing is compared while nothing or zero at once
/// is sent, or zeros are held: wheels then roll, or brake as they can.
void iw_watch_pair(struct iw_gateway *self, const iw_pair_t *applied, bool heard);

#endif
