// SPDX-License-Identifier: MIT
/// @file
/// How fast may the pair turn the machine, and how fast may its turning grow?
///
///     command --(yaw limit: both wheels by one factor)--> maximum speed --> ramp --(growth of yaw)--> pair
///
/// Both limits hold for the real machine: a setpoint in mm/s means that speed at IW_SETPOINT_RADIUS_MM, so the real
/// one is setpoint x `radius_mm` / IW_SETPOINT_RADIUS_MM. Yaw is right minus left by `track_mm`. Configuration and
/// track become two bounds of that difference.
///
/// No limit makes a wheel faster than asked, changes its sign, or moves one that was commanded 0. Growth is bounded
/// under a drive command only: a stop, a command of 0/0 and a yaw that falls know no limit here.
#ifndef IW_YAW_H
#define IW_YAW_H

#include "iwheel/types.h"

/// What is configured, checked: the ranges of iw_config_t keep every product within 32 bits.
typedef struct {
    uint32_t max_yaw_mrad_s;    ///< Of the real machine.
    uint32_t yaw_accel_mrad_s2; ///< Of the real machine.
    uint32_t track_mm;          ///< Distance of the wheels; 0, not set: no turn is within its bounds.
    uint32_t radius_mm;         ///< Of the wheels.
} iw_yaw_machine_t;

/// Bounds of the difference of both setpoints, right minus left.
typedef struct {
    int32_t most_mm_s;     ///< Of its magnitude.
    uint32_t growth_mm_s2; ///< Of how fast its magnitude may grow.
} iw_yaw_t;

/// Once, so that no step divides.
void iw_yaw_init(iw_yaw_t *self, const iw_yaw_machine_t *machine);

/// Scales both speeds (each within int16) by one factor, so that the curve stays. True if they had to be.
bool iw_yaw_limit(const iw_yaw_t *self, int32_t speed_mm_s[IW_SIDES]);

/// How large the difference may be after a step under a drive command, without sign. `growth_um_s`: what `growth_mm_s2`
/// allows in its time. It never has to fall.
int32_t iw_yaw_bound(const iw_yaw_t *self, int32_t from_um_s, uint32_t growth_um_s);

/// How much of a change, without sign, may be gone where all of it would lead from within that bound to beyond it. Less
/// than the change.
uint32_t iw_yaw_room(int32_t bound_um_s, int32_t from_um_s, int32_t change_um_s);

#endif
