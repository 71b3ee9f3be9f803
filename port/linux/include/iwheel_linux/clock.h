// SPDX-License-Identifier: MIT
/// @file
/// The clocks. All decisions use the monotonic clock. The wall clock is only reported.
#ifndef IWHEEL_LINUX_CLOCK_H
#define IWHEEL_LINUX_CLOCK_H

#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Returns CLOCK_MONOTONIC in microseconds. It never steps, and it stops while the machine is suspended.
iw_time_us_t iwl_clock_now_us(void);

/// Returns the time that the machine has been suspended since its start, which CLOCK_MONOTONIC does not count. The
/// result is never too large. It is too small by the time for which this call was interrupted.
iw_time_us_t iwl_clock_suspended_us(void);

/// Returns CLOCK_MONOTONIC from one reading of a clock that continues in a suspend. A suspend after `suspended_us` was
/// read makes the result larger, so that it appears as lateness.
iw_time_us_t iwl_clock_awake_us(iw_time_us_t suspended_us);

/// Returns CLOCK_MONOTONIC and the suspended time together.
iw_time_us_t iwl_clock_read(iw_time_us_t *out_suspended_us);

/// Returns CLOCK_REALTIME in microseconds since 1970. It may step in either direction.
int64_t iwl_clock_wall_us(void);

#ifdef __cplusplus
}
#endif
#endif
