// SPDX-License-Identifier: MIT
/// Two wheels and their bus in memory, so that the examples run anywhere. They are not a model of real wheels (see
/// app/sim): a setpoint is echoed immediately, and the wheel has the commanded speed from then on.
#ifndef PRETEND_WHEELS_H
#define PRETEND_WHEELS_H

#include "iwheel/hal.h"

typedef struct {
    iw_can_frame_t queue[8]; ///< Oldest first.
    unsigned count;
    int16_t speed_mm_s[IW_SIDES];
    int16_t fastest_mm_s;
} pretend_wheels_t;

/// Sends the speed message of each wheel. Call it once a millisecond.
void pretend_wheels_run(pretend_wheels_t *self);

/// Returns the five functions of a port. `self` must exist as long as they are used.
iw_hal_t pretend_wheels_hal(pretend_wheels_t *self);

#endif
