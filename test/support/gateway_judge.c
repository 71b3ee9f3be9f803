// SPDX-License-Identifier: MIT
#include "gateway_judge.h"

#include <stdlib.h>
#include <string.h>

/// Rounding error of both ends of a slope.
#define ROUNDING_MM_S 2

static void blame(gateway_judge_t *self, bool bad, const char *violation) {
    if (bad && self->violation == NULL) {
        self->violation = violation;
    }
}

static bool is_zero(const gateway_judge_t *self, const iw_command_t *command) {
    return command->speed_mm_s == 0 && (self->config->current_role == IW_ROLE_LIMIT || command->current_mA == 0);
}

static void judge_form(gateway_judge_t *self, const iw_can_frame_t *frame, const iw_command_t *command) {
    const iw_config_t *const config = self->config;
    blame(self, frame->id != 266U && frame->id != 298U, "8: not a setpoint's id");
    blame(self, frame->dlc != config->setpoint_dlc, "8: wrong length");
    blame(self, !config->setpoint_type_set || frame->data[0] != config->setpoint_type, "8: wrong setpoint type");
    blame(self, abs(command->current_mA) > config->max_current_mA, "8: current above the maximum");
    blame(self, abs(command->speed_mm_s) > config->max_speed_mm_s, "8: speed above the maximum");
    blame(self, config->listen_only, "listen only, but something was sent");
}

static void judge_slope(gateway_judge_t *self, iw_side_t side, int32_t speed_mm_s) {
    const iw_config_t *const config = self->config;
    const int32_t before_mm_s = self->speed_mm_s[side];
    const iw_time_us_t elapsed_us = self->bus->now_us - self->frame_us[side];
    const bool away = abs(speed_mm_s) > abs(before_mm_s);
    const uint64_t slope_mm_s2 = away ? config->accel_mm_s2 : config->decel_mm_s2;
    const uint64_t allowed = slope_mm_s2 * elapsed_us / 1000000U + ROUNDING_MM_S;
    blame(self, speed_mm_s * before_mm_s < 0, "8: the sign changed without a zero");
    blame(self, (uint64_t)abs(speed_mm_s - before_mm_s) > allowed, "8: steeper than the slope");
}

static void judge_right_to_move(gateway_judge_t *self, iw_side_t side, int32_t speed_mm_s) {
    const iw_config_t *const config = self->config;
    const iw_time_us_t ramp_us = (iw_time_us_t)config->max_speed_mm_s * 1000000U / config->decel_mm_s2;
    const iw_time_us_t last_us = self->drive_us + MS(config->lease_ms) + MS(config->period_ms) + ramp_us;
    const int32_t before_mm_s = self->speed_mm_s[side];
    const iw_state_t state = iw_gateway_state(self->gateway);
    const bool grows = abs(speed_mm_s) > abs(before_mm_s) || speed_mm_s * before_mm_s < 0;
    blame(self, self->drive_us == IW_NEVER || self->bus->now_us > last_us, "1: moving too long after the last drive");
    const iw_stop_t *const stop = &self->gateway->permit.stop;
    const bool ramps =
        stop->cause == IW_CAUSE_PAIR_DIVERGES || (stop->cause == IW_CAUSE_WHEEL_LOST && stop->sides != IW_SIDES_BOTH);
    blame(self, state == IW_STATE_LISTENING, "3: nonzero while listening");
    blame(self,
          state == IW_STATE_LATCHED && (!ramps || self->bus->now_us > stop->at_us + ramp_us + MS(config->period_ms)),
          "3: nonzero while latched, and no ramp of one wheel offline or of a pair that diverges");
    blame(self, self->no_tail, "2, 7: a ramp tail where zero was due immediately");
    blame(self, !self->fresh && grows, "3: motion without a fresh command");
    blame(self, self->pair_broken, "5: nonzero after a broken pair");
}

static void judge_frame(void *context, const iw_can_frame_t *frame, bool accepted) {
    gateway_judge_t *const self = context;
    const iw_side_t side = (frame->id == IW_ID_LEFT_SETPOINT) ? IW_LEFT : IW_RIGHT;
    const iw_command_t command = fake_bus_command(frame);
    const bool zero = is_zero(self, &command);
    const bool listening = iw_gateway_state(self->gateway) == IW_STATE_LISTENING;
    judge_form(self, frame, &command);
    blame(self, listening && !iw_gateway_arming(self->gateway), "3: sent while listening");
    blame(self, self->tried[side], "7: two setpoints for one wheel in one step");
    blame(self, side == IW_LEFT && self->tried[IW_RIGHT], "right before left");
    blame(self, self->bus->unechoed[side] >= (zero ? 2U : 1U), "6: too many un-echoed setpoints");
    blame(self, !zero && self->bus->call_frames != IW_SIDES, "5: motion for one wheel in a separate call");
    blame(self, self->bus->call_frame != ((self->bus->call_frames == IW_SIDES && side == IW_RIGHT) ? 1U : 0U),
          "5: right before left in one call");
    if (!zero) {
        judge_slope(self, side, command.speed_mm_s);
        judge_right_to_move(self, side, command.speed_mm_s);
    }
    self->tried[side] = true;
    self->accepted[side] = accepted;
    self->step_moves = self->step_moves || !zero;
    self->frames++;
    self->moving_frames += zero ? 0U : 1U;
    if (accepted) {
        self->frame_us[side] = self->bus->now_us;
        self->speed_mm_s[side] = command.speed_mm_s;
    }
}

void gateway_judge_init(gateway_judge_t *self, const iw_gateway_t *gateway, fake_bus_t *bus) {
    memset(self, 0, sizeof *self);
    self->config = &gateway->config;
    self->gateway = gateway;
    self->bus = bus;
    self->drive_us = IW_NEVER;
    self->asked_us = IW_NEVER;
    self->gap_us = bus->now_us;
    bus->listener = judge_frame;
    bus->listener_context = self;
}

void gateway_judge_asked(gateway_judge_t *self, bool nonzero) {
    self->asked_us = nonzero ? self->bus->now_us : self->asked_us;
}

void gateway_judge_drive(gateway_judge_t *self, bool nonzero) {
    self->drive_us = self->bus->now_us;
    if (nonzero) {
        self->fresh = true;
        self->no_tail = false;
    }
}

void gateway_judge_renew(gateway_judge_t *self) {
    const iw_time_us_t ago_us = self->bus->now_us - self->asked_us;
    blame(self, self->asked_us != IW_NEVER && ago_us < MS(500), "3: armed or reset with a stale command");
    self->fresh = false;
}

void gateway_judge_before(gateway_judge_t *self, bool pressed, iw_time_us_t late_us) {
    memset(self->tried, 0, sizeof self->tried);
    memset(self->accepted, 0, sizeof self->accepted);
    self->step_moves = false;
    if (pressed || late_us >= IW_GATEWAY_STOP_US || self->bus->state < IW_BUS_PASSIVE) {
        self->fresh = false;
        self->no_tail = true;
    }
    if (late_us > 0) {
        self->gap_us = self->bus->now_us;
    }
}

static void judge_gap(gateway_judge_t *self) {
    const fake_bus_t *const bus = self->bus;
    const bool sending = iw_permit_demand(&self->gateway->permit) != IW_DEMAND_SILENCE;
    const bool accepts = bus->state >= IW_BUS_PASSIVE && bus->acknowledged && bus->send_result[IW_LEFT] > 0 &&
                         bus->send_result[IW_RIGHT] > 0 && bus->flights == 0;
    if (!sending || !accepts) {
        self->gap_us = bus->now_us;
    }
    for (size_t side = 0; side < IW_SIDES; side++) {
        const iw_time_us_t from_us = (self->frame_us[side] > self->gap_us) ? self->frame_us[side] : self->gap_us;
        blame(self, bus->now_us - from_us >= MS(100), "4: a gap of 100 ms between setpoints");
    }
}

static void judge_pair(gateway_judge_t *self) {
    const bool tried = self->tried[IW_LEFT] || self->tried[IW_RIGHT];
    const bool whole = self->accepted[IW_LEFT] && self->accepted[IW_RIGHT];
    blame(self, self->step_moves && self->accepted[IW_LEFT] && !self->tried[IW_RIGHT], "5: left without right");
    if (tried) {
        self->pair_broken = self->step_moves && !whole;
    }
}

void gateway_judge_after(gateway_judge_t *self, iw_time_us_t wake_us) {
    const iw_time_us_t now_us = self->bus->now_us;
    judge_pair(self);
    judge_gap(self);
    self->fresh = self->fresh && iw_gateway_state(self->gateway) == IW_STATE_ARMED;
    blame(self, wake_us > now_us + MS(self->config->period_ms), "wants to sleep longer than a period");
    blame(self, wake_us <= now_us && !self->gateway->backlog, "wants to be called again immediately");
}
