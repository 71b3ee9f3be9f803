// SPDX-License-Identifier: MIT
/// Two wheels and their bus in a few lines of memory, so that the examples run anywhere. Not a model of the real ones
/// (that is app/sim): a setpoint is echoed at once, and the wheel turns as told from then on.
#ifndef PRETEND_WHEELS_H
#define PRETEND_WHEELS_H

#include "iwheel/hal.h"

typedef struct {
    iw_can_frame_t queue[8]; ///< Oldest first.
    unsigned count;
    int16_t speed_mm_s[IW_SIDES];
    int16_t fastest_mm_s;
} pretend_wheels_t;

/// Once a millisecond: each wheel tells its speed.
void pretend_wheels_run(pretend_wheels_t *self);

/// The five functions of a port.
iw_hal_t pretend_wheels_hal(pretend_wheels_t *self);

#endif
