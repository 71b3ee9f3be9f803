// SPDX-License-Identifier: MIT
/// How far the machine turns from its commanded path, at most, when one wheel does something else: a figure for each class.
///
/// Computed from the configuration with decelerations that are assumed, as bringup measures none: of a wheel that is sent
/// zero, and of one that coasts. Both are the simulator's. docs/user/pair.md has what the simulator shows.
#ifndef GW_ANGLES_H
#define GW_ANGLES_H

#include "config/gateway_config.h"

#define GW_ANGLES_BRAKE_MM_S2 4700U ///< Assumed: sent zero at once.
#define GW_ANGLES_COAST_MM_S2 700U  ///< Assumed: friction alone.

/// In tenths of a degree.
typedef struct {
    unsigned unnoticed; ///< A second, of a steady difference that is never noticed.
    unsigned blocked;   ///< One wheel stands at once, at the maximum speed.
    unsigned slow;      ///< One wheel falls to a quarter.
    unsigned coasting;  ///< One wheel coasts while the other one ramps to zero.
    unsigned runs_on;   ///< A second, of one wheel that goes on at the maximum speed while the other one stands.
    unsigned late;      ///< One wheel obeys 100 ms later than the other.
} gw_angles_t;

/// Of a configuration that has been checked and names its track.
gw_angles_t gw_angles(const gateway_config_t *config);

#endif
