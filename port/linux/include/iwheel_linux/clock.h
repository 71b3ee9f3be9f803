// SPDX-License-Identifier: MIT
/// @file
/// The two clocks. Only the monotonic one decides anything; the wall clock is an annotation.
#ifndef IWHEEL_LINUX_CLOCK_H
#define IWHEEL_LINUX_CLOCK_H

#include "iwheel/types.h"

/// CLOCK_MONOTONIC in microseconds. Never steps, does not run while the machine is suspended.
iw_time_us_t iwl_clock_now_us(void);

/// For how long the machine has been suspended since it was started: what CLOCK_MONOTONIC did not count.
/// Never too much; too little by as long as this call was interrupted.
iw_time_us_t iwl_clock_suspended_us(void);

/// CLOCK_MONOTONIC by one reading of a clock that goes on in a suspend: ahead by what the machine was suspended beyond
/// `suspended_us`, so that a suspend shows as lateness.
iw_time_us_t iwl_clock_awake_us(iw_time_us_t suspended_us);

/// Both at once.
iw_time_us_t iwl_clock_read(iw_time_us_t *out_suspended_us);

/// CLOCK_REALTIME in microseconds since 1970. May step in either direction.
int64_t iwl_clock_wall_us(void);

#endif
