// SPDX-License-Identifier: MIT
/// Largest angle by which the machine leaves its commanded path when one wheel deviates, for each class of fault.
///
/// It is computed from the configuration and two assumed decelerations, of a wheel that receives zero and of a wheel
/// that coasts, because bringup does not measure them. Both are those of the simulator; docs/user/pair.md has its
/// results.
#ifndef GW_ANGLES_H
#define GW_ANGLES_H

#include "config/gateway_config.h"

#define GW_ANGLES_BRAKE_MM_S2 4700U ///< Assumed deceleration of a wheel that receives zero.
#define GW_ANGLES_COAST_MM_S2 700U  ///< Assumed deceleration by friction alone.

/// Angles in tenths of a degree.
typedef struct {
    unsigned unnoticed; ///< Per second, with a steady difference that is never detected.
    unsigned blocked;   ///< One wheel stops immediately at the maximum speed.
    unsigned slow;      ///< One wheel falls to a quarter of its speed.
    unsigned coasting;  ///< One wheel coasts while the other one ramps to zero.
    unsigned runs_on;   ///< Per second, with one wheel at the maximum speed and the other one at standstill.
    unsigned late;      ///< One wheel follows 100 ms later than the other.
} gw_angles_t;

/// Computes the angles for a checked configuration with a track.
gw_angles_t gw_angles(const gateway_config_t *config);

#endif
