// SPDX-License-Identifier: MIT
#include "replay.h"

#include "iwheel/codec.h"

#define PERIOD_US 4000U
/// For the first frames, and for the arming to be proven.
#define SLACK_US 500000U
/// After rest_ms of rest.
#define ARM_LATER_US 32000U

/// rpm that a wheel would show which does what it was told.
static int16_t obedient_rpm(const replay_t *self, size_t side, const iw_can_frame_t *setpoint) {
    iw_codec_wheel_t told[IW_SIDES];
    if (setpoint == NULL || iw_codec_decode(setpoint, told) != IW_CODEC_SETPOINT) {
        return 0;
    }
    return (int16_t)(told[side].setpoint.speed_mm_s * 1000 / (int32_t)replay_look(self).wheel[side].um_s_per_rpm);
}

/// A cycle of the made-up bus: both wheels show what they were told last.
static void turn(replay_t *self, iw_time_us_t at_us, iw_can_frame_t last[IW_SIDES]) {
    for (uint32_t i = 0; i < self->frames; i++) { // Echoes of the last step.
        last[iw_codec_side(self->frame[i].id)] = self->frame[i];
    }
    for (size_t side = 0; side < IW_SIDES; side++) {
        iw_can_frame_t frame;
        const iw_codec_wheel_t told = {
            .speed = {.speed_rpm = obedient_rpm(self, side, (last[side].id != 0U) ? &last[side] : NULL)}};
        if (iw_codec_encode(IW_CODEC_SPEED, (iw_side_t)side, &told, &frame) == IW_OK) {
            (void)replay_frame(self, &frame);
        }
    }
    replay_step(self, at_us);
}

static iw_time_us_t ramp_us(const iw_config_t *config, const blackbox_drive_t *drive) {
    int64_t fastest = 0;
    for (size_t side = 0; side < IW_SIDES; side++) {
        const int64_t speed =
            (drive->speed_mm_s[side] < 0) ? -(int64_t)drive->speed_mm_s[side] : drive->speed_mm_s[side];
        fastest = (speed > fastest) ? speed : fastest;
    }
    fastest = (fastest > config->max_speed_mm_s) ? config->max_speed_mm_s : fastest;
    return (iw_time_us_t)fastest * 1000000U / config->accel_mm_s2;
}

static void keep_driving(replay_t *self, const blackbox_entry_t *state, iw_time_us_t at_us) {
    const iw_config_t *config = replay_look(self).config;
    iw_drive_t wanted = {.has_current = config->current_role == IW_ROLE_SETPOINT};
    iw_applied_t applied;
    for (size_t side = 0; side < IW_SIDES; side++) {
        wanted.speed_mm_s[side] = state->as.drive.speed_mm_s[side];
        wanted.current_mA[side] = wanted.has_current ? (int32_t)config->max_current_mA : 0;
    }
    (void)iw_gateway_drive(&self->gateway, at_us, state->number, &wanted, &applied);
}

/// Arms for the recorded holder, drives until the ramp is through; returns when it is.
static void drive_up(replay_t *self, const blackbox_entry_t *state, iw_time_us_t from_us) {
    iw_can_frame_t last[IW_SIDES] = {0};
    const iw_time_us_t rest_us = (iw_time_us_t)replay_look(self).config->rest_ms * IW_US_PER_MS;
    const bool moves = state->a != (uint8_t)IW_STATE_LISTENING;
    bool asked = false;
    for (iw_time_us_t at_us = from_us; at_us < state->at_us; at_us += PERIOD_US) {
        turn(self, at_us, last);
        if (moves && !asked && at_us - from_us > rest_us + ARM_LATER_US) {
            asked = true;
            (void)iw_gateway_arm(&self->gateway, at_us, state->number, false);
        }
        if (iw_gateway_state(&self->gateway) == IW_STATE_ARMED) {
            keep_driving(self, state, at_us);
        }
    }
}

bool replay_warm(replay_t *self, const iw_config_t *config, const blackbox_entry_t *state) {
    const int estop = self->estop;
    const iw_bus_state_t bus = self->bus;
    const iw_time_us_t needed_us =
        (iw_time_us_t)config->rest_ms * IW_US_PER_MS + ramp_us(config, &state->as.drive) + SLACK_US;
    const iw_time_us_t from_us = (state->at_us > needed_us) ? state->at_us - needed_us : 0U;
    const char *names[] = {self->estop_name, self->bus_name};
    replay_init(self, config, from_us, self->out);
    self->estop_name = names[0];
    self->bus_name = names[1];
    self->quiet = true;
    self->echoes = true;
    drive_up(self, state, from_us);
    if (state->a == (uint8_t)IW_STATE_STOPPING) {
        iw_gateway_stop(&self->gateway, state->at_us, state->number, IW_CAUSE_CLIENT_STOP);
    } else if (state->a == (uint8_t)IW_STATE_LATCHED) {
        iw_gateway_estop(&self->gateway, state->at_us, state->number);
    }
    self->estop = estop;
    self->bus = bus;
    self->echoes = false;
    replay_step(self, state->at_us);
    self->quiet = false;
    self->zero_us = state->at_us;
    self->total_frames = 0;
    self->total_sent = 0;
    self->sent_count[IW_LEFT] = 0;
    self->sent_count[IW_RIGHT] = 0;
    self->compares = true;
    return (uint8_t)iw_gateway_state(&self->gateway) == state->a;
}
