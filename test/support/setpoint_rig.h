// SPDX-License-Identifier: MIT
/// A setpoint scheduler at a virtual time.
#ifndef TEST_SETPOINT_RIG_H
#define TEST_SETPOINT_RIG_H

#include "fixture.h"
#include "iwheel/private/setpoint.h"

typedef struct {
    iw_config_t config;
    iw_setpoint_t setpoint;
    iw_time_us_t now_us;
} setpoint_rig_t;

/// Begins without setpoints, with the configuration of the fixture and limits of yaw that no ramp reaches.
void setpoint_rig_init(setpoint_rig_t *self);

/// Begins again with the rig's configuration.
void setpoint_rig_begin(setpoint_rig_t *self);

/// Commands both speeds now, with the same current for both wheels.
void setpoint_rig_command(setpoint_rig_t *self, int16_t left_mm_s, int16_t right_mm_s, int16_t current_mA);

/// Sets the demand now.
void setpoint_rig_demand(setpoint_rig_t *self, iw_demand_t demand);

/// Advances to the time when the next pair is due and returns the pair.
iw_pair_t setpoint_rig_take_next(setpoint_rig_t *self);

/// Lets time pass and returns the pair that must be due then.
iw_pair_t setpoint_rig_take_after(setpoint_rig_t *self, iw_time_us_t for_us);

/// Goes from SILENCE to FOLLOW and reads the first pair.
void setpoint_rig_follow(setpoint_rig_t *self);

/// Goes from SILENCE to a speed that has been constant for a long time.
void setpoint_rig_cruise(setpoint_rig_t *self, int16_t left_mm_s, int16_t right_mm_s, int16_t current_mA);

/// Returns true if the last pair is zero.
bool setpoint_rig_is_zero(const setpoint_rig_t *self);

#endif
