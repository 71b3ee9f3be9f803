// SPDX-License-Identifier: MIT
/// @file
/// Limits of the yaw rate and of its growth.
///
///     command --(yaw limit: both wheels by one factor)--> maximum speed --> ramp --(growth of yaw)--> pair
///
/// Both limits apply to the real machine. A setpoint in mm/s is that speed at IW_SETPOINT_RADIUS_MM, so the real speed
/// is setpoint x `radius_mm` / IW_SETPOINT_RADIUS_MM. The yaw rate is the difference right minus left, divided by
/// `track_mm`. Configuration and track result in two limits of that difference.
///
/// No limit makes a wheel faster than requested, changes its sign, or moves a wheel that is commanded 0. The growth is
/// limited under a drive command only: there is no limit for a stop, a command of 0/0, or a yaw rate that falls.
#ifndef IW_YAW_H
#define IW_YAW_H

#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Checked configuration of the machine. With the ranges of iw_config_t every product fits 32 bits.
typedef struct {
    uint32_t max_yaw_mrad_s;    ///< Largest yaw rate of the real machine.
    uint32_t yaw_accel_mrad_s2; ///< Largest growth of the yaw rate of the real machine.
    uint32_t track_mm;          ///< Distance between the wheels. With 0 (not set) no turn is allowed.
    uint32_t radius_mm;         ///< Radius of the wheels.
} iw_yaw_machine_t;

/// Limits of the difference of both setpoints, right minus left.
typedef struct {
    int32_t most_mm_s;     ///< Largest absolute difference.
    uint32_t growth_mm_s2; ///< Largest growth of the absolute difference.
} iw_yaw_t;

/// Computes the limits once, so that no step divides.
void iw_yaw_init(iw_yaw_t *self, const iw_yaw_machine_t *machine);

/// Scales both speeds (each within int16) by one factor, so that the curve remains. Returns true if it scaled them.
bool iw_yaw_limit(const iw_yaw_t *self, int32_t speed_mm_s[IW_SIDES]);

/// Returns the largest absolute difference after a step under a drive command. `growth_um_s`: growth that
/// `growth_mm_s2` allows in the time of the step. The result is never below the present absolute difference
/// `from_um_s`.
int32_t iw_yaw_bound(const iw_yaw_t *self, int32_t from_um_s, uint32_t growth_um_s);

/// Returns the part of a change, without sign, that stays within the limit. Call it for a change that would exceed the
/// limit: the result is then smaller than the change.
uint32_t iw_yaw_margin(int32_t bound_um_s, int32_t from_um_s, int32_t change_um_s);

#ifdef __cplusplus
}
#endif
#endif
