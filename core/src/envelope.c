// SPDX-License-Identifier: MIT
#include "iwheel/private/transmit.h"

#include "arithmetic.h"
#include "iwheel/codec.h"

/// The speeds of a pair are rounded to whole mm/s. Rounding alone can increase their difference by this.
#define TURN_ROUNDING_MM_S 2U
/// Radius of setpoints. It is defined again here, so that this file shares no error with others.
#define SETPOINT_RADIUS_MM 192U

/// Longest elapsed time that counts.
static IW_APART uint32_t counted_us(iw_time_us_t last_us, iw_time_us_t now_us) {
    const uint32_t elapsed_us = iw_age_us(last_us, now_us);
    return (elapsed_us < IW_ENVELOPE_ELAPSED_MAX_US) ? elapsed_us : IW_ENVELOPE_ELAPSED_MAX_US;
}

/// Returns the largest change in mm/s that `slope` allows in that time, plus 1 mm/s for the rounding of both speeds.
static uint32_t allowance(uint32_t slope_mm_s2, uint32_t elapsed_us) {
    const uint32_t change_um_s = slope_mm_s2 * (elapsed_us / 1000U) + slope_mm_s2 * (elapsed_us % 1000U) / 1000U;
    return 1U + change_um_s / 1000U;
}

/// A reversal must pass through a zero that was sent, even if both slopes together would allow the step.
static bool slew_ok(const iw_envelope_t *self, iw_side_t side, iw_time_us_t now_us, int32_t speed_mm_s) {
    const int32_t last_mm_s = self->last_mm_s[side];
    const uint32_t from = (uint32_t)iw_abs(last_mm_s);
    const uint32_t to = (uint32_t)iw_abs(speed_mm_s);
    if (speed_mm_s != 0 && last_mm_s != 0 && (speed_mm_s < 0) != (last_mm_s < 0)) {
        return false;
    }
    if (to == from) {
        return true;
    }
    const uint32_t slope_mm_s2 = (to > from) ? self->config->accel_mm_s2 : self->config->decel_mm_s2;
    const uint32_t change = (to > from) ? to - from : from - to;
    const uint32_t elapsed_us = counted_us(self->last_us[side], now_us);
    return change <= allowance(slope_mm_s2, elapsed_us);
}

/// Reads the bytes like the wheel, without the core's codec, because an error of the codec would hide itself.
static iw_codec_setpoint_t as_the_wheel_reads(const uint8_t *data) {
    const iw_codec_setpoint_t setpoint = {
        .speed_mm_s = (int16_t)(uint16_t)(data[1] * 256U + data[2]),
        .current_mA = (int16_t)(uint16_t)(data[3] * 256U + data[4]),
        .type = data[0],
    };
    return setpoint;
}

/// With IW_ROLE_LIMIT a zero has a current: with a limit of 0 mA a motor has no torque to stop with.
static bool is_zero(const iw_config_t *config, const iw_codec_setpoint_t *setpoint) {
    return setpoint->speed_mm_s == 0 && (config->current_role == IW_ROLE_LIMIT || setpoint->current_mA == 0);
}

static bool type_ok(const iw_config_t *config, uint8_t type) {
    return config->setpoint_type_set && config->current_role != IW_ROLE_UNSET && type == config->setpoint_type;
}

static bool current_ok(const iw_config_t *config, int32_t current_mA) {
    // A wheel with a limit near 0 has no torque. The document does not define a limit below zero.
    const bool low_limit = config->current_role == IW_ROLE_LIMIT && current_mA < (int32_t)config->min_current_mA;
    return !low_limit && (uint32_t)iw_abs(current_mA) <= config->max_current_mA;
}

static iw_envelope_verdict_t judge(const iw_envelope_t *self, iw_time_us_t now_us, iw_side_t side,
                                   const iw_codec_setpoint_t *setpoint) {
    const iw_config_t *const config = self->config;
    if (!type_ok(config, setpoint->type)) {
        return IW_ENVELOPE_TYPE;
    }
    if (!current_ok(config, setpoint->current_mA)) {
        return IW_ENVELOPE_CURRENT;
    }
    if ((uint32_t)iw_abs(setpoint->speed_mm_s) > config->max_speed_mm_s) {
        return IW_ENVELOPE_SPEED;
    }
    // R8: the slope never delays a stop.
    if (!is_zero(config, setpoint) && !slew_ok(self, side, now_us, setpoint->speed_mm_s)) {
        return IW_ENVELOPE_SLEW;
    }
    return IW_ENVELOPE_PASS;
}

iw_envelope_verdict_t iw_envelope_check(iw_envelope_t *self, const iw_can_frame_t *frame, iw_time_us_t now_us) {
    const bool left = frame->id == IW_ID_LEFT_SETPOINT;
    const iw_side_t side = left ? IW_LEFT : IW_RIGHT;
    const iw_codec_setpoint_t setpoint = as_the_wheel_reads(frame->data);
    iw_envelope_verdict_t verdict = IW_ENVELOPE_NOT_A_SETPOINT;
    if ((left || frame->id == IW_ID_RIGHT_SETPOINT) && frame->dlc == self->config->setpoint_dlc) {
        verdict = judge(self, now_us, side, &setpoint);
    }
    if (verdict == IW_ENVELOPE_PASS) {
        self->last_us[side] = now_us;
        self->last_mm_s[side] = setpoint.speed_mm_s;
    } else {
        self->stopped++;
    }
    return verdict;
}

/// Returns |right - left| in the machine's frame.
static uint32_t turn_of(const iw_config_t *config, int32_t left_mm_s, int32_t right_mm_s) {
    const int32_t left = config->invert[IW_LEFT] ? -left_mm_s : left_mm_s;
    const int32_t right = config->invert[IW_RIGHT] ? -right_mm_s : right_mm_s;
    return (uint32_t)iw_abs(right - left);
}

/// R17 without division: mrad/s = mm/s x radius x 1000 / (192 mm x track). A pair with no larger yaw rate than the last
/// one passes, like every stop.
static bool turn_ok(const iw_envelope_t *self, iw_time_us_t now_us, uint32_t turn_mm_s) {
    const iw_config_t *const config = self->config;
    const uint32_t span_mm2 = config->track_mm * SETPOINT_RADIUS_MM;
    const uint32_t most = turn_of(config, self->last_mm_s[IW_LEFT], self->last_mm_s[IW_RIGHT]) + TURN_ROUNDING_MM_S;
    if ((uint64_t)turn_mm_s * config->radius_mm * 1000U > (uint64_t)span_mm2 * config->max_yaw_mrad_s) {
        return false;
    }
    if (turn_mm_s <= most) {
        return true;
    }
    // A zero may have passed for one wheel alone. The time of the pair counts from the later frame.
    const iw_time_us_t last_us =
        (self->last_us[IW_LEFT] > self->last_us[IW_RIGHT]) ? self->last_us[IW_LEFT] : self->last_us[IW_RIGHT];
    return (uint64_t)((turn_mm_s - most) * config->radius_mm) * 1000000000U <=
           (uint64_t)(span_mm2 * config->yaw_accel_mrad_s2) * counted_us(last_us, now_us);
}

iw_envelope_verdict_t iw_envelope_check_pair(iw_envelope_t *self, const iw_can_frame_t frame[IW_SIDES],
                                             iw_time_us_t now_us) {
    const uint32_t turn_mm_s = turn_of(self->config, as_the_wheel_reads(frame[IW_LEFT].data).speed_mm_s,
                                       as_the_wheel_reads(frame[IW_RIGHT].data).speed_mm_s);
    if (!turn_ok(self, now_us, turn_mm_s)) {
        self->stopped++;
        return IW_ENVELOPE_YAW;
    }
    return IW_ENVELOPE_PASS;
}
