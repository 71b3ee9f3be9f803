// SPDX-License-Identifier: MIT
#include "iwheel/private/setpoint.h"

#include "arithmetic.h"
#include "iwheel/codec.h"
#include "iwheel/private/current.h"

#include <string.h>

/// Fractions are in 1/2^24: three digits of 8 bits each, so that 32-bit divisions suffice.
#define FRACTION_BITS 24U
#define FRACTION_ONE  (1U << FRACTION_BITS)

/// A speed and a current for each wheel.
#define AXES (2 * IW_SIDES)

/// Change of each quantity in this step, and the share of it that applies: one share for quantities that brake, and one
/// for the others.
typedef struct {
    int32_t aim[AXES];
    uint32_t share[2];
    bool braking[AXES]; ///< The quantity moves towards zero.
} step_t;

/// Sets the command to zero.
static void forget_command(iw_setpoint_t *self) {
    const bool limit = self->config->current_role == IW_ROLE_LIMIT;
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->target.wheel[side].speed_mm_s = 0;
        self->target.wheel[side].current_mA = limit ? (int16_t)self->config->max_current_mA : (int16_t)0;
    }
}

/// Sets the output to zero.
static void clear(iw_setpoint_t *self) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->speed_um_s[side] = 0;
        self->current_uA[side] = 0;
        self->limit_mA[side] = (int16_t)self->config->max_current_mA;
    }
    self->from_zero = true;
    forget_command(self);
}

void iw_setpoint_init(iw_setpoint_t *self, const iw_config_t *config) {
    const iw_yaw_machine_t machine = {config->max_yaw_mrad_s, config->yaw_accel_mrad_s2, config->track_mm,
                                      config->radius_mm};
    memset(self, 0, sizeof *self);
    self->config = config;
    iw_yaw_init(&self->yaw, &machine);
    self->last_us = IW_NEVER;
    self->due_us = IW_NEVER;
    clear(self);
}

void iw_setpoint_hasten(iw_setpoint_t *self, iw_time_us_t now_us) {
    iw_time_us_t due_us = now_us;
    if (self->demand == IW_DEMAND_SILENCE) {
        return;
    }
    if (iw_age_us(self->last_us, now_us) < IW_SETPOINT_SPACING_US) {
        due_us = self->last_us + IW_SETPOINT_SPACING_US;
    }
    if (due_us < self->due_us) {
        self->due_us = due_us;
    }
}

void iw_setpoint_demand(iw_setpoint_t *self, iw_time_us_t now_us, iw_demand_t demand) {
    if (demand == self->demand) {
        return;
    }
    self->demand = demand;
    forget_command(self);
    if (demand == IW_DEMAND_SILENCE) {
        clear(self);
        self->last_us = IW_NEVER;
        self->due_us = IW_NEVER;
    } else if (demand == IW_DEMAND_ZERO) {
        clear(self);
        self->due_us = now_us;
    } else {
        iw_setpoint_hasten(self, now_us);
    }
}

static bool same_command(const iw_command_t *a, const iw_command_t *b) {
    return a->speed_mm_s == b->speed_mm_s && a->current_mA == b->current_mA;
}

void iw_setpoint_command(iw_setpoint_t *self, iw_time_us_t now_us, const iw_pair_t *target) {
    const bool same = same_command(&self->target.wheel[IW_LEFT], &target->wheel[IW_LEFT]) &&
                      same_command(&self->target.wheel[IW_RIGHT], &target->wheel[IW_RIGHT]);
    if (self->demand == IW_DEMAND_FOLLOW && !same) {
        self->target = *target;
        iw_setpoint_hasten(self, now_us);
    }
}

void iw_setpoint_collapse(iw_setpoint_t *self, iw_time_us_t now_us) {
    clear(self);
    iw_setpoint_hasten(self, now_us);
}

/// Returns part / whole for part < whole < 2^24.
static uint32_t fraction_of(uint32_t part, uint32_t whole) {
    uint32_t fraction = 0;
    uint32_t rest = part;
    for (uint32_t digit = 0; digit < FRACTION_BITS / 8U; digit++) {
        rest <<= 8;
        fraction = (fraction << 8) | (rest / whole); // NOLINT(clang-analyzer-core.DivideZero)
        rest %= whole;
    }
    return fraction;
}

/// Returns part / whole for any part; 1 if part is not smaller than whole.
static uint32_t portion_of(uint32_t part, uint32_t whole) {
    return (part < whole) ? fraction_of(part, whole) : FRACTION_ONE;
}

/// Returns slope x time in thousandths of the unit of the slope, for at most a second.
static IW_APART uint32_t ramp_step(uint32_t slope, uint32_t us) {
    return slope * (us / 1000U) + slope * (us % 1000U) / 1000U;
}

/// Converts a speed step to the same share of the maximum current. `step` is at most 20 m/s, the steepest slope for a
/// second, so 32 bits suffice.
static IW_APART uint32_t current_step(const iw_config_t *config, uint32_t step) {
    const uint32_t speed = config->max_speed_mm_s;
    return step / speed * config->max_current_mA + step % speed * config->max_current_mA / speed;
}

/// Computes the change of each quantity; none passes zero in one step. All have one common share of their changes, but
/// braking quantities do not wait for accelerating ones. `allowed`: largest change now, away from zero and towards it.
static void plan(step_t *step, size_t i, int32_t value, int32_t target, const uint32_t allowed[2]) {
    const bool through_zero = value != 0 && (target < 0) != (value < 0);
    const int32_t aim = through_zero ? 0 : target;
    const uint32_t way = (uint32_t)iw_abs(aim - value);
    const bool braking = (uint32_t)iw_abs(aim) < (uint32_t)iw_abs(value);
    const uint32_t fraction = portion_of(allowed[braking ? 1U : 0U], way);
    step->aim[i] = aim;
    step->braking[i] = braking;
    if (fraction < step->share[0]) {
        step->share[0] = fraction;
    }
    if (braking && fraction < step->share[1]) {
        step->share[1] = fraction;
    }
}

static IW_APART int32_t part_of_way(const step_t *step, size_t i, int32_t value) {
    const int32_t way = step->aim[i] - value;
    return (int32_t)((int64_t)step->share[step->braking[i] ? 1U : 0U] * way / (int64_t)FRACTION_ONE);
}

/// Returns the change of the difference right minus left by the wheels that brake, or by those that do not.
static IW_APART int32_t turn_by(const step_t *step, const int32_t *speed, bool braking) {
    const int32_t left = (step->braking[IW_LEFT] == braking) ? part_of_way(step, IW_LEFT, speed[IW_LEFT]) : 0;
    const int32_t right = (step->braking[IW_RIGHT] == braking) ? part_of_way(step, IW_RIGHT, speed[IW_RIGHT]) : 0;
    return right - left;
}

/// Reduces the share of the quantities that brake, or of those that do not. Currents follow their speeds.
static IW_APART void cut_step(step_t *step, bool braking, uint32_t fraction) {
    uint32_t *const share = &step->share[braking ? 1U : 0U];
    const uint32_t whole = *share;
    const uint32_t cut = (uint32_t)((uint64_t)whole * fraction / FRACTION_ONE);
    *share = (cut < whole) ? cut : whole; // A share of a share is never larger; Eva cannot derive that.
}

/// R17: under a drive command the yaw rate grows no faster than allowed. `us`: time of the step that counts. Wheels
/// that become faster wait first. A braking wheel approaches its command, whose yaw rate is within the limit, so it
/// reaches it. A stop is not slowed: towards 0/0 all speeds brake by one share, and the yaw rate only falls.
static void limit_yaw(const iw_setpoint_t *self, step_t *step, uint32_t us) {
    const int32_t from = self->speed_um_s[IW_RIGHT] - self->speed_um_s[IW_LEFT];
    const int32_t bound = iw_yaw_bound(&self->yaw, from, ramp_step(self->yaw.growth_mm_s2, us));
    const int32_t braking = turn_by(step, self->speed_um_s, true);
    const int32_t faster = turn_by(step, self->speed_um_s, false);
    const int32_t braked = from + braking;
    if (iw_abs(braked + faster) <= bound) {
        return;
    }
    if (iw_abs(braked) <= bound) {
        cut_step(step, false, portion_of(iw_yaw_margin(bound, braked, faster), (uint32_t)iw_abs(faster)));
    } else {
        cut_step(step, true, portion_of(iw_yaw_margin(bound, from, braking), (uint32_t)iw_abs(braking)));
        step->share[0] = 0;
    }
}

/// Returns true if the wheel's speed and current have reached the command.
static IW_APART bool arrived(const iw_setpoint_t *self, iw_side_t side) {
    const iw_command_t *const target = &self->target.wheel[side];
    const bool ramps_current = self->config->current_role == IW_ROLE_SETPOINT;
    return self->speed_um_s[side] == target->speed_mm_s * 1000 &&
           self->current_uA[side] == (ramps_current ? target->current_mA * 1000 : 0);
}

static void advance(iw_setpoint_t *self, uint32_t elapsed_us) {
    const iw_config_t *const config = self->config;
    const iw_command_t *const target = self->target.wheel;
    // After a second every ramp has ended.
    const uint32_t us = (elapsed_us < IW_WHEEL_WATCHDOG_US) ? elapsed_us : IW_WHEEL_WATCHDOG_US;
    const uint32_t granted_us = 2U * config->period_ms * IW_US_PER_MS;
    const uint32_t away_us = (us < granted_us) ? us : granted_us;
    const uint32_t speeds[2] = {ramp_step(config->accel_mm_s2, away_us), ramp_step(config->decel_mm_s2, us)};
    const uint32_t currents[2] = {current_step(config, speeds[0]), current_step(config, speeds[1])};
    const bool ramps_current = config->current_role == IW_ROLE_SETPOINT;
    step_t step = {.share = {FRACTION_ONE, FRACTION_ONE}};
    for (size_t side = 0; side < IW_SIDES; side++) {
        const int32_t current_uA = ramps_current ? target[side].current_mA * 1000 : 0;
        plan(&step, side, self->speed_um_s[side], target[side].speed_mm_s * 1000, speeds);
        plan(&step, IW_SIDES + side, self->current_uA[side], current_uA, currents);
    }
    limit_yaw(self, &step, away_us);
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->speed_um_s[side] += part_of_way(&step, side, self->speed_um_s[side]);
        self->current_uA[side] += part_of_way(&step, IW_SIDES + side, self->current_uA[side]);
    }
}

static iw_time_us_t next_on_grid(const iw_setpoint_t *self, iw_time_us_t now_us) {
    const iw_time_us_t period_us = (iw_time_us_t)self->config->period_ms * IW_US_PER_MS;
    const iw_time_us_t next_us = self->due_us + period_us;
    return (next_us >= now_us + IW_SETPOINT_SPACING_US) ? next_us : now_us + period_us;
}

iw_pair_t iw_setpoint_next(iw_setpoint_t *self, iw_time_us_t now_us) {
    const uint32_t elapsed_us = iw_age_us(self->last_us, now_us);
    if (!self->from_zero && !(arrived(self, IW_LEFT) && arrived(self, IW_RIGHT))) {
        advance(self, elapsed_us);
    }
    if (!self->from_zero) { // A first zero has the maximum.
        iw_current_follow(self->limit_mA, &self->target, elapsed_us);
    }
    self->from_zero = false;
    self->due_us = next_on_grid(self, now_us);
    self->last_us = now_us;
    return iw_setpoint_applied(self);
}

iw_pair_t iw_setpoint_applied(const iw_setpoint_t *self) {
    iw_pair_t pair;
    for (size_t side = 0; side < IW_SIDES; side++) {
        pair.wheel[side].speed_mm_s = (int16_t)(self->speed_um_s[side] / 1000);
        pair.wheel[side].current_mA = (self->config->current_role == IW_ROLE_LIMIT)
                                          ? self->limit_mA[side]
                                          : (int16_t)(self->current_uA[side] / 1000);
    }
    return pair;
}

static bool all_zero(const int32_t *values) {
    return (values[IW_LEFT] | values[IW_RIGHT]) == 0;
}

bool iw_setpoint_is_zero(const iw_setpoint_t *self) {
    return all_zero(self->speed_um_s) && all_zero(self->current_uA);
}

bool iw_setpoint_next_is_zero(const iw_setpoint_t *self) {
    const iw_command_t *const left = &self->target.wheel[IW_LEFT];
    const iw_command_t *const right = &self->target.wheel[IW_RIGHT];
    if (self->from_zero || !iw_setpoint_is_zero(self)) {
        return iw_setpoint_is_zero(self);
    }
    return left->speed_mm_s == 0 && right->speed_mm_s == 0 &&
           (self->config->current_role == IW_ROLE_LIMIT || (left->current_mA == 0 && right->current_mA == 0));
}
