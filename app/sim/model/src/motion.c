// SPDX-License-Identifier: MIT
#include "iwheel_sim/motion.h"

/// Circumference at 192 mm radius.
#define CIRCUMFERENCE_nm INT64_C(1206371579)
/// Longest step of integration: a third of the shortest sensible response time.
#define STEP_MAX_US 20000U
/// A slower wheel with setpoint 0 is at standstill.
#define STICTION_um_s 2000
/// Losses of the motor: current that it draws while it turns.
#define IDLE_DRAW_mA   150U
#define TOP_SPEED_um_s 6000000
/// Speed at which a hand turns a wheel.
#define PUSH_um_s 1500000

void sim_motion_default(sim_motion_config_t *out_config) {
    *out_config = (sim_motion_config_t){
        .accel_mm_s2 = 4000U,
        .coast_mm_s2 = 700U,
        .response_us = 60000U,
        .radius_mm = SIM_FIRMWARE_RADIUS_MM,
        .gear_turns = 1U,
        .gear_per = 1U,
        .accepted_type = SIM_TYPE_ANY,
    };
}

void sim_motion_init(sim_motion_t *self, const sim_motion_config_t *config, iw_time_us_t now_us) {
    *self = (sim_motion_t){.config = *config, .now_us = now_us, .received_us = IW_NEVER};
}

static int64_t clamp(int64_t value, int64_t bound) {
    if (value > bound) {
        return bound;
    }
    return (value < -bound) ? -bound : value;
}

/// Returns the speed after `dt_us` without a motor. Friction holds the wheel on a slope that is not steeper than the
/// friction.
static int64_t coasting(const sim_motion_t *self, int64_t speed_um_s, int64_t dt_us) {
    int64_t const friction = (int64_t)self->config.coast_mm_s2 * dt_us / 1000;
    int64_t const pulled = speed_um_s + (int64_t)self->slope_mm_s2 * dt_us / 1000;
    return pulled - clamp(pulled, friction);
}

/// Returns the acceleration by the current, in mm/s2, with the sign of the current.
static int64_t torque_mm_s2(const sim_motion_t *self) {
    int64_t const current = clamp(self->setpoint.current_mA, IW_CURRENT_LIMIT_mA);
    return (int64_t)self->config.accel_mm_s2 * current / IW_CURRENT_LIMIT_mA;
}

static int64_t approaching(const sim_motion_t *self, int64_t target_um_s, int64_t torque, int64_t dt_us) {
    int64_t const speed = self->speed_um_s;
    int64_t const error = target_um_s - speed;
    int64_t const response = self->config.response_us;
    bool const braking = (error < 0) == (speed > 0) && speed != 0;
    int64_t const uphill = (error < 0) ? self->slope_mm_s2 : -(int64_t)self->slope_mm_s2;
    int64_t const left_over = torque + (braking ? (int64_t)self->config.coast_mm_s2 : 0) - uphill;
    int64_t const helped = (left_over > 0) ? left_over : 0;
    int64_t const wanted = (dt_us >= response) ? error : error * dt_us / response;
    int64_t const next = speed + clamp(wanted, helped * dt_us / 1000);
    return (target_um_s == 0 && clamp(next, STICTION_um_s) == next) ? 0 : next;
}

static int64_t driving(const sim_motion_t *self, int64_t dt_us) {
    int64_t const torque = torque_mm_s2(self);
    int64_t const values = (int64_t)self->setpoint.speed_mm_s * (1000 - self->droop_permille);
    if (self->freewheels) {
        return coasting(self, self->speed_um_s, dt_us);
    }
    if (self->runaway_mm_s != 0) {
        int64_t const more = (int64_t)self->runaway_mm_s * 1000;
        return approaching(self, values + ((values < 0) ? -more : more), self->config.accel_mm_s2, dt_us);
    }
    if (torque == 0) {
        return coasting(self, self->speed_um_s, dt_us);
    }
    if (self->config.current_is_setpoint && values == 0) {
        return clamp(self->speed_um_s + torque * dt_us / 1000, TOP_SPEED_um_s);
    }
    return approaching(self, clamp(values, TOP_SPEED_um_s), (torque < 0) ? -torque : torque, dt_us);
}

static void count_ticks(sim_motion_t *self, int64_t way_nm) {
    int64_t const tick = CIRCUMFERENCE_nm * self->config.gear_per;
    int64_t const signed_way = self->swapped ? -way_nm : way_nm;
    int64_t const total = self->tick_rest + signed_way * (int64_t)IW_TICKS_PER_TURN * self->config.gear_turns;
    int64_t ticks = total / tick;
    if (total % tick < 0) {
        ticks -= 1;
    }
    self->tick_rest = total - ticks * tick;
    self->ticks += (uint32_t)(uint64_t)ticks;
}

/// Moves the wheel by hand. The hand is stronger than the motor, and releases the wheel at standstill.
static void follow_hand(sim_motion_t *self, int64_t dt_us) {
    int64_t const way_nm = clamp(self->push_nm, PUSH_um_s * dt_us / 1000);
    self->push_nm -= way_nm;
    self->accel_mm_s2 = 0;
    self->motor_mm_s2 = 0;
    self->speed_um_s = (self->push_nm == 0) ? 0 : (self->push_nm > 0) ? PUSH_um_s : -PUSH_um_s;
    self->position_nm += way_nm;
    count_ticks(self, way_nm);
}

/// Returns the part of a speed that a kerb leaves.
static int64_t over_kerb(const sim_motion_t *self, int64_t speed_um_s) {
    return speed_um_s * (1000 - self->kerb_permille) / 1000;
}

/// Distributes the acceleration of both motors by the yaw inertia: the sum stays, the difference becomes smaller.
/// Returns the new speed.
static int64_t share_out(sim_motion_t *self, int64_t before, int64_t after, int64_t dt_us) {
    int64_t const permille = self->config.yaw_permille;
    int64_t const other = (int64_t)self->other_motor_mm_s2 * dt_us / 1000;
    self->motor_mm_s2 = (int32_t)((after - before) * 1000 / dt_us);
    return (permille == 0) ? after : before + ((after - before) * 1000 + other * permille) / (1000 + permille);
}

static void integrate(sim_motion_t *self, int64_t dt_us) {
    if (self->push_nm != 0) {
        follow_hand(self, dt_us);
        return;
    }
    int64_t const before = self->speed_um_s;
    int64_t after = 0;
    self->motor_mm_s2 = 0;
    if (!self->blocked) {
        after = self->driven ? driving(self, dt_us) : coasting(self, before, dt_us);
        after = share_out(self, before, after, dt_us);
    }
    int64_t const way_nm = over_kerb(self, before + after) * dt_us / 2000;
    self->speed_um_s = (int32_t)after;
    self->accel_mm_s2 = (int32_t)((after - before) * 1000 / dt_us);
    self->position_nm += way_nm;
    count_ticks(self, way_nm);
}

/// Returns the end of the next step of integration. Nothing changes within a step.
static iw_time_us_t step_end_us(const sim_motion_t *self, iw_time_us_t to_us) {
    iw_time_us_t end_us = to_us;
    if (self->driven && self->received_us + IW_WHEEL_WATCHDOG_US < end_us) {
        end_us = self->received_us + IW_WHEEL_WATCHDOG_US;
    }
    return (end_us - self->now_us > STEP_MAX_US) ? self->now_us + STEP_MAX_US : end_us;
}

void sim_motion_advance(sim_motion_t *self, iw_time_us_t to_us) {
    while (self->now_us < to_us) {
        if (!self->driven && self->speed_um_s == 0 && self->push_nm == 0 && self->slope_mm_s2 == 0) {
            self->accel_mm_s2 = 0;
            self->motor_mm_s2 = 0;
            self->now_us = to_us;
            return;
        }
        iw_time_us_t const end_us = step_end_us(self, to_us);
        if (end_us > self->now_us) {
            integrate(self, (int64_t)(end_us - self->now_us));
        }
        self->now_us = end_us;
        if (self->driven && end_us - self->received_us >= IW_WHEEL_WATCHDOG_US) {
            self->driven = false;
        }
    }
}

bool sim_motion_receive(sim_motion_t *self, iw_time_us_t now_us, const iw_codec_setpoint_t *setpoint) {
    sim_motion_advance(self, now_us);
    if (self->config.accepted_type != SIM_TYPE_ANY && self->config.accepted_type != setpoint->type) {
        return false;
    }
    self->setpoint = *setpoint;
    self->received_us = now_us;
    self->driven = true;
    self->setpoints += 1U;
    return true;
}

void sim_motion_release(sim_motion_t *self, iw_time_us_t now_us) {
    sim_motion_advance(self, now_us);
    self->driven = false;
}

void sim_motion_push(sim_motion_t *self, iw_time_us_t now_us, int32_t way_mm) {
    sim_motion_advance(self, now_us);
    self->push_nm += (int64_t)way_mm * 1000000 * SIM_FIRMWARE_RADIUS_MM / self->config.radius_mm;
}

int64_t sim_motion_milli_rpm(const sim_motion_t *self) {
    int64_t const wheel = over_kerb(self, self->speed_um_s) * 60000000 / CIRCUMFERENCE_nm;
    int64_t const signed_wheel = self->swapped ? -wheel : wheel;
    if (!self->config.rpm_of_rotor) {
        return signed_wheel;
    }
    return signed_wheel * self->config.gear_turns / self->config.gear_per;
}

int32_t sim_motion_um_s_of_milli_rpm(const sim_motion_config_t *config, int64_t milli_rpm) {
    int64_t const wheel = config->rpm_of_rotor ? milli_rpm * config->gear_per / config->gear_turns : milli_rpm;
    return (int32_t)clamp(wheel * CIRCUMFERENCE_nm / 60000000, INT32_MAX);
}

int32_t sim_motion_true_mm_s(const sim_motion_t *self) {
    return (int32_t)(over_kerb(self, self->speed_um_s) * self->config.radius_mm / SIM_FIRMWARE_RADIUS_MM / 1000);
}

int64_t sim_motion_true_mm(const sim_motion_t *self) {
    return self->position_nm / SIM_FIRMWARE_RADIUS_MM * self->config.radius_mm / 1000000;
}

uint32_t sim_motion_draw_mA(const sim_motion_t *self) {
    if (!self->driven) {
        return 0U;
    }
    if (self->blocked && self->setpoint.speed_mm_s != 0) {
        int64_t const current = clamp(self->setpoint.current_mA, IW_CURRENT_LIMIT_mA);
        return (uint32_t)((current < 0) ? -current : current);
    }
    int64_t const accel = (self->accel_mm_s2 < 0) ? -(int64_t)self->accel_mm_s2 : self->accel_mm_s2;
    uint32_t const torque =
        (uint32_t)clamp(accel * IW_CURRENT_LIMIT_mA / (int64_t)self->config.accel_mm_s2, IW_CURRENT_LIMIT_mA);
    return torque + ((self->speed_um_s != 0) ? IDLE_DRAW_mA : 0U);
}
