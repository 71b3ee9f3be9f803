// SPDX-License-Identifier: MIT
#include "setpoint_rig.h"

#include "unity.h"

#include <string.h>

void setpoint_rig_begin(setpoint_rig_t *self) {
    memset(&self->setpoint, FIXTURE_POISON, sizeof self->setpoint);
    iw_setpoint_init(&self->setpoint, &self->config);
    self->now_us = FIXTURE_START_US;
}

void setpoint_rig_init(setpoint_rig_t *self) {
    fixture_config(&self->config);
    // These limits are too wide for any ramp to reach: unit_yaw judges the limits of yaw.
    self->config.max_yaw_mrad_s = 10000;
    self->config.yaw_accel_mrad_s2 = 10000;
    self->config.track_mm = 1500;
    self->config.radius_mm = 60;
    setpoint_rig_begin(self);
}

void setpoint_rig_command(setpoint_rig_t *self, int16_t left_mm_s, int16_t right_mm_s, int16_t current_mA) {
    const iw_pair_t target = {{{left_mm_s, current_mA}, {right_mm_s, current_mA}}};
    iw_setpoint_command(&self->setpoint, self->now_us, &target);
}

void setpoint_rig_demand(setpoint_rig_t *self, iw_demand_t demand) {
    iw_setpoint_demand(&self->setpoint, self->now_us, demand);
}

iw_pair_t setpoint_rig_take_next(setpoint_rig_t *self) {
    const iw_time_us_t next_us = iw_setpoint_next_us(&self->setpoint);
    TEST_ASSERT_TRUE_MESSAGE(next_us != IW_NEVER, "no pair will ever be due");
    return setpoint_rig_take_after(self, (next_us > self->now_us) ? next_us - self->now_us : 0);
}

iw_pair_t setpoint_rig_take_after(setpoint_rig_t *self, iw_time_us_t for_us) {
    self->now_us += for_us;
    TEST_ASSERT_TRUE_MESSAGE(iw_setpoint_due(&self->setpoint, self->now_us), "a pair must be due");
    return iw_setpoint_next(&self->setpoint, self->now_us);
}

void setpoint_rig_follow(setpoint_rig_t *self) {
    setpoint_rig_demand(self, IW_DEMAND_FOLLOW);
    (void)setpoint_rig_take_next(self);
}

void setpoint_rig_cruise(setpoint_rig_t *self, int16_t left_mm_s, int16_t right_mm_s, int16_t current_mA) {
    setpoint_rig_follow(self);
    setpoint_rig_command(self, left_mm_s, right_mm_s, current_mA);
    for (uint32_t i = 0; i < 8000U / self->config.period_ms; i++) {
        (void)setpoint_rig_take_next(self);
    }
    const iw_pair_t pair = iw_setpoint_applied(&self->setpoint);
    TEST_ASSERT_EQUAL_INT16(left_mm_s, pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT16(right_mm_s, pair.wheel[IW_RIGHT].speed_mm_s);
}

bool setpoint_rig_is_zero(const setpoint_rig_t *self) {
    return iw_setpoint_is_zero(&self->setpoint);
}
