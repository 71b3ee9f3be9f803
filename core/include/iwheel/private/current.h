// SPDX-License-Identifier: MIT
/// @file
/// Current limits of a client (IW_ROLE_LIMIT): a wheel without torque neither drives nor brakes.
///
///     request --as large as the larger side, floor--> target --falls by 4000 mA/s, rises immediately--> applied
///
/// A machine on two wheels turns when one of them has less torque than the other, so both sides get the larger limit
/// unless `asymmetric_current` allows a difference. The core raises a limit that is too low and does not refuse it: a
/// refusal would let the lease run out. Zeros always carry `max_current_mA`, so that the wheels brake with it.
///
/// Pure functions: no state, no clock. Nothing here changes a current of IW_ROLE_SETPOINT.
#ifndef IW_CURRENT_H
#define IW_CURRENT_H

#include "iwheel/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A limit falls by 1 mA in this time: 4000 mA/s.
#define IW_CURRENT_FALL_US 250U

/// Returns the lowest limit that is sent: `min_current_mA`, or `max_current_mA` if that is lower.
static inline int32_t iw_current_floor(const iw_config_t *config) {
    return (config->min_current_mA < config->max_current_mA) ? config->min_current_mA : config->max_current_mA;
}

/// Replaces the requested limits, within 0..max_current_mA, by the limits to send. `zero`: both speeds are 0. Returns
/// true if a limit differs from the request.
bool iw_current_limit(const iw_config_t *config, int32_t limit_mA[IW_SIDES], bool zero);

/// Moves the applied limits to the target limits: a higher limit applies immediately, a lower one is reached at 1 mA in
/// IW_CURRENT_FALL_US.
void iw_current_follow(int16_t limit_mA[IW_SIDES], const iw_pair_t *target, uint32_t elapsed_us);

#ifdef __cplusplus
}
#endif
#endif
