// SPDX-License-Identifier: MIT
#include "iwheel_sim/pair.h"

#define SAG_mA_PER_dV 500U

void sim_pair_default(sim_pair_config_t *out_config) {
    *out_config = (sim_pair_config_t){.track_mm = 540U, .battery_dV = 248U};
    sim_wheel_config_t *const left = &out_config->wheel[IW_LEFT];
    sim_wheel_config_t *const right = &out_config->wheel[IW_RIGHT];
    *left = (sim_wheel_config_t){
        .sensor_zero_mN = 12300, .boot_us = 400000U, .offset_us = SIM_WHEEL_OFFSET_US, .unit = IW_FORCE_CN};
    *right = (sim_wheel_config_t){
        .sensor_zero_mN = 9800, .boot_us = 430000U, .offset_us = SIM_WHEEL_OFFSET_US, .unit = IW_FORCE_DN};
    sim_motion_default(&left->motion);
    sim_motion_default(&right->motion);
}

void sim_pair_init(sim_pair_t *self, const sim_pair_config_t *config, iw_time_us_t now_us, uint64_t seed) {
    sim_pair_config_t standard;
    if (config == NULL) {
        sim_pair_default(&standard);
        config = &standard;
    }
    *self = (sim_pair_t){.battery_dV = config->battery_dV, .power = true};
    self->pose.track_mm = config->track_mm;
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        self->pose.mirrored[side] = config->mirrored[side];
        sim_wheel_init(&self->wheel[side], &config->wheel[side], (iw_side_t)side, seed);
        sim_wheel_power(&self->wheel[side], now_us, true);
        if (config->age_us > 0U) {
            sim_wheel_age(&self->wheel[side], now_us, config->age_us);
        }
    }
    sim_pose_restart(&self->pose, now_us, 0);
}

iw_time_us_t sim_pair_next_us(const sim_pair_t *self) {
    iw_time_us_t const left_us = self->wheel[IW_LEFT].next_us;
    iw_time_us_t const right_us = self->wheel[IW_RIGHT].next_us;
    return (left_us <= right_us) ? left_us : right_us;
}

static void swap_pairs_of_bytes(iw_can_frame_t *frame) {
    for (size_t i = 0U; i + 1U < frame->dlc; i += 2U) {
        uint8_t const first = frame->data[i];
        frame->data[i] = frame->data[i + 1U];
        frame->data[i + 1U] = first;
    }
}

static void encode(const sim_pair_t *self, iw_side_t side, const sim_message_t *message, iw_can_frame_t *out_frame) {
    (void)iw_codec_encode(message->kind, side, &message->values, out_frame);
    if (self->pose_reversed && message->kind == IW_CODEC_POSE) {
        swap_pairs_of_bytes(out_frame);
    }
    if (self->padded) {
        out_frame->dlc = IW_CAN_DATA_MAX;
    }
}

/// Sets in each wheel the acceleration of the other wheel's motor whenever one of them sends: every 2 ms.
static void couple(sim_pair_t *self) {
    sim_motion_t *const left = &self->wheel[IW_LEFT].motion;
    sim_motion_t *const right = &self->wheel[IW_RIGHT].motion;
    left->other_motor_mm_s2 = right->motor_mm_s2;
    right->other_motor_mm_s2 = left->motor_mm_s2;
}

bool sim_pair_step(sim_pair_t *self, iw_time_us_t now_us, sim_sent_t *out_sent) {
    for (;;) {
        iw_time_us_t const due_us = sim_pair_next_us(self);
        if (due_us > now_us || due_us == IW_NEVER) {
            return false;
        }
        iw_side_t const side = (self->wheel[IW_LEFT].next_us == due_us) ? IW_LEFT : IW_RIGHT;
        sim_message_t message;
        couple(self);
        if (sim_wheel_step(&self->wheel[side], sim_pair_battery_dV(self), &self->pose, &message)) {
            out_sent->due_us = due_us;
            out_sent->side = side;
            encode(self, side, &message, &out_sent->frame);
            return true;
        }
    }
}

static void receive_left_speed(sim_pair_t *self, iw_time_us_t now_us, const iw_codec_speed_t *speed) {
    if (self->wheel[IW_RIGHT].state == SIM_WHEEL_RUNNING) {
        int64_t const milli_rpm = (int64_t)speed->speed_rpm * 1000;
        sim_motion_config_t const *const config = &self->wheel[IW_RIGHT].motion.config;
        sim_pose_receive_left(&self->pose, now_us, sim_motion_um_s_of_milli_rpm(config, milli_rpm));
    }
}

void sim_pair_receive(sim_pair_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame) {
    iw_codec_wheel_t values[IW_SIDES];
    iw_codec_kind_t const kind = iw_codec_decode(frame, values);
    iw_side_t const side = iw_codec_side(frame->id);
    if (kind == IW_CODEC_SETPOINT) {
        sim_wheel_receive(&self->wheel[side], now_us, &values[side].setpoint);
    } else if (kind == IW_CODEC_SPEED && side == IW_LEFT) {
        receive_left_speed(self, now_us, &values[IW_LEFT].speed);
    }
}

bool sim_pair_acknowledges(const sim_pair_t *self) {
    return self->wheel[IW_LEFT].state == SIM_WHEEL_RUNNING || self->wheel[IW_RIGHT].state == SIM_WHEEL_RUNNING;
}

void sim_pair_power(sim_pair_t *self, iw_time_us_t now_us, bool on) {
    self->power = on;
    sim_wheel_power(&self->wheel[IW_LEFT], now_us, on);
    sim_wheel_power(&self->wheel[IW_RIGHT], now_us, on);
}

void sim_pair_reboot(sim_pair_t *self, iw_time_us_t now_us, iw_side_t side) {
    sim_wheel_reboot(&self->wheel[side], now_us);
}

uint8_t sim_pair_battery_dV(const sim_pair_t *self) {
    uint32_t const draw_mA =
        sim_motion_draw_mA(&self->wheel[IW_LEFT].motion) + sim_motion_draw_mA(&self->wheel[IW_RIGHT].motion);
    uint32_t const sag_dV = draw_mA / SAG_mA_PER_dV;
    return (uint8_t)((sag_dV < self->battery_dV) ? self->battery_dV - sag_dV : 0U);
}
