// SPDX-License-Identifier: MIT
#include "oracle_parts.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LATE_US (20U * MS)
#define STOP_US (100U * MS)
#define HUNG_US (500U * MS)
#define DRAIN   512U
/// A pause of offset frames that shows a reboot, and one that may show one.
#define BACK_US       (6000U * MS)
#define BACK_MAYBE_US (4900U * MS)

bool oracle_elapsed(iw_time_us_t now_us, iw_time_us_t since_us, iw_time_us_t span_us) {
    return since_us != IW_NEVER && now_us - since_us >= span_us;
}

iw_time_us_t oracle_us(uint32_t ms) {
    return (iw_time_us_t)ms * MS;
}

void oracle_break(oracle_t *self, iw_time_us_t now_us, uint32_t rule, const char *format, ...) {
    va_list arguments;
    if (self->rule != ORACLE_NO_RULE) {
        return;
    }
    self->rule = rule;
    self->broken_us = now_us;
    va_start(arguments, format);
    (void)vsnprintf(self->text, sizeof self->text, format, arguments);
    va_end(arguments);
}

void oracle_start(oracle_t *self, const iw_gateway_t *gateway, iw_time_us_t now_us, bool restarted) {
    const bool proven = self->proven;
    const bool purges = self->purges;
    const iw_time_us_t edge_us = self->edge_us;
    memset(self, 0, sizeof *self);
    self->proven = proven;
    self->purges = purges;
    self->edge_us = edge_us;
    self->gateway = gateway;
    self->config = &gateway->config;
    self->restarting = restarted;
    self->hold_active = restarted && gateway->config.hold;
    self->hard = true;
    self->state = iw_gateway_state(gateway);
    self->stopped_us = now_us;
    if (restarted && self->state != IW_STATE_STOPPING) {
        oracle_break(self, now_us, 509, "no zeros for a process that died while it was sending");
    }
    self->late_us = now_us;
    self->ramp_us = self->foreign_us = self->nonzero_drive_us = self->refused_us = self->silent_us = IW_NEVER;
    self->turning_us = self->turned_us = self->setpoint_us = IW_NEVER;
    self->stops = self->latch_stop = gateway->permit.stop.number;
    self->estop_us[0] = self->estop_us[1] = IW_NEVER;
    self->bus_bad_us = now_us;
    for (size_t side = 0; side < IW_SIDES; side++) {
        oracle_wheel_t *const wheel = &self->wheel[side];
        wheel->fresh_us = wheel->rest_us = wheel->sent_us = wheel->tried_us = IW_NEVER;
        wheel->against_us = wheel->faster_us = wheel->blocked_us = wheel->ticks_us = wheel->offset_us = IW_NEVER;
        wheel->accepted_zero = true;
    }
}

iw_time_us_t oracle_hold_max_us(const oracle_t *self, iw_time_us_t from_us) {
    const bool contested = self->foreign_us != IW_NEVER && self->foreign_us >= from_us;
    return contested ? CONTESTED_US : (iw_time_us_t)self->config->hold_max_s * 1000U * MS;
}

/// The zeros are timed from here, or from the last time when a hold without end observed a wheel that turns.
iw_time_us_t oracle_zeros_from(const oracle_t *self, iw_time_us_t from_us) {
    return (self->unsettled_us > from_us) ? self->unsettled_us : from_us;
}

static bool zeros_are_over(const oracle_t *self, iw_time_us_t now_us, iw_time_us_t from_us, iw_time_us_t slack_us) {
    const iw_time_us_t since_us = oracle_zeros_from(self, from_us);
    return oracle_elapsed(now_us, since_us, oracle_hold_max_us(self, since_us) + slack_us);
}

static void lose_permission(oracle_t *self) {
    self->armed = false;
    self->fresh = false;
    self->holder = IW_CLIENT_NONE;
    self->pending_arm = IW_CLIENT_NONE;
}

void oracle_hard_stop(oracle_t *self) {
    lose_permission(self);
    self->hard = true;
    self->ramp_us = IW_NEVER;
}

void oracle_soft_stop(oracle_t *self, iw_time_us_t at_us) {
    if (self->armed && self->ramp_us == IW_NEVER) {
        self->ramp_us = at_us;
    }
    lose_permission(self);
}

// ---- input of the gateway --------------------------------------------------------------------------------------

void oracle_step_begin(oracle_t *self, iw_time_us_t now_us, iw_time_us_t promised_us) {
    const iw_time_us_t late_us = (now_us > promised_us) ? now_us - promised_us : 0U;
    const bool late = late_us > LATE_US;
    self->stalled = late || (self->stalled && self->received >= DRAIN);
    self->late_stop = late_us >= STOP_US;
    self->hung = late_us > HUNG_US;
    self->received = 0;
    self->foreign_now = self->jump_now = self->back_now = self->may_be_back = false;
    self->was_arming = iw_gateway_arming(self->gateway);
    for (size_t side = 0; side < IW_SIDES; side++) {
        oracle_wheel_t *const wheel = &self->wheel[side];
        wheel->tried_now = wheel->accepted_now = false;
        wheel->before = wheel->speed;
        if (late && wheel->fresh_us != IW_NEVER && wheel->fresh_us >= wheel->excused_us) {
            wheel->excused_us = now_us;
        }
    }
    if (self->stalled) {
        self->late_us = now_us;
    }
    if (self->late_stop) {
        oracle_hard_stop(self);
    }
}

void oracle_note_estop(oracle_t *self, iw_time_us_t now_us, unsigned which) {
    const iw_time_us_t last_us = self->estop_us[which];
    self->estop_new = self->estop_new || last_us == IW_NEVER || oracle_elapsed(now_us, last_us, EVENT_US);
    self->estop_us[which] = now_us;
}

void oracle_estop(oracle_t *self, iw_time_us_t now_us, int result) {
    self->estop = result;
    if (result != 0) {
        oracle_hard_stop(self);
    }
    if (result != 0 && result != IW_ESTOP_DISAGREES) {
        oracle_note_estop(self, now_us, 0);
    }
}

void oracle_bus(oracle_t *self, iw_time_us_t now_us, iw_bus_state_t state) {
    self->bus = state;
    if (state >= IW_BUS_PASSIVE) {
        return;
    }
    self->bus_bad_us = now_us;
    oracle_hard_stop(self);
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->wheel[side].pending = 0;
        self->wheel[side].proven_us = 0;
    }
}

void oracle_purged(oracle_t *self) {
    self->wheel[IW_LEFT].pending = self->wheel[IW_RIGHT].pending = 0;
    self->wheel[IW_LEFT].proven_us = self->wheel[IW_RIGHT].proven_us = 0;
}

static int32_t word(const uint8_t *bytes) {
    const int32_t value = bytes[0] * 256 + bytes[1];
    return (value >= 32768) ? value - 65536 : value;
}

static void receive_speed(oracle_t *self, iw_time_us_t now_us, oracle_wheel_t *wheel, int32_t rpm) {
    const bool gap = oracle_elapsed(now_us, wheel->fresh_us, oracle_us(self->config->wheel_silent_ms));
    wheel->rpm = rpm;
    if (abs(rpm) > self->config->rest_rpm) {
        wheel->rest_us = IW_NEVER;
    } else if (!self->stalled && (gap || wheel->rest_us == IW_NEVER)) {
        wheel->rest_us = now_us;
    }
    if (!self->stalled) {
        wheel->fresh_us = now_us;
    }
}

static void receive_ticks(oracle_t *self, iw_time_us_t now_us, oracle_wheel_t *wheel, const uint8_t *bytes) {
    const uint32_t raw = (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
    const uint32_t moved = raw - (uint32_t)wheel->ticks;
    const int64_t way = (moved > INT32_MAX) ? (int64_t)moved - UINT32_MAX - 1 : (int64_t)moved;
    // 13 m/s, and 40 ticks of slack: no wheel of this kind is that fast.
    if (wheel->ticks_us != IW_NEVER && llabs(way) > 40 + (int64_t)((now_us - wheel->ticks_us) / (3U * MS / 2U))) {
        self->jump_now = true;
    }
    wheel->ticks = (int32_t)raw;
    wheel->ticks_us = now_us;
}

/// Telemetry of a wheel was received.
static void receive_wheel(oracle_t *self, iw_time_us_t now_us, size_t side, bool offset) {
    oracle_wheel_t *const wheel = &self->wheel[side];
    if (wheel->offset_us == IW_NEVER) {
        wheel->offset_us = now_us;
    }
    if (offset) {
        self->back_now = self->back_now || now_us - wheel->offset_us >= BACK_US;
        self->may_be_back = self->may_be_back || now_us - wheel->offset_us >= BACK_MAYBE_US;
        wheel->offset_us = now_us;
    }
}

static void receive_echo(oracle_t *self, oracle_wheel_t *wheel) {
    (void)self;
    if (wheel->pending == 0U) {
        return;
    }
    wheel->proven_us = wheel->waiting[0];
    wheel->pending--;
    memmove(&wheel->waiting[0], &wheel->waiting[1], wheel->pending * sizeof wheel->waiting[0]);
}

void oracle_received(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame) {
    const bool right = (frame->id & 32U) != 0U;
    oracle_wheel_t *const wheel = &self->wheel[right ? IW_RIGHT : IW_LEFT];
    self->received++;
    if (frame->id == 266U || frame->id == 298U) {
        if (frame->kind == IW_CAN_ECHO) {
            receive_echo(self, wheel);
            return;
        }
        self->foreign_us = now_us;
        self->foreign++;
        self->foreign_now = true;
        oracle_hold_foreign(self);
        oracle_hard_stop(self);
    } else if ((frame->id == 256U || frame->id == 288U) && frame->dlc >= 4U && frame->dlc <= 8U) {
        receive_speed(self, now_us, wheel, word(frame->data));
        receive_wheel(self, now_us, right ? IW_RIGHT : IW_LEFT, false);
    } else if ((frame->id == 257U || frame->id == 289U) && frame->dlc >= 7U && frame->dlc <= 8U) {
        receive_ticks(self, now_us, wheel, &frame->data[2]);
    } else if ((frame->id == 513U || frame->id == 545U) && frame->dlc >= 2U && frame->dlc <= 8U) {
        receive_wheel(self, now_us, right ? IW_RIGHT : IW_LEFT, true);
    }
}

// ---- output of the gateway -------------------------------------------------------------------------------------

static void judge_form(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame) {
    const iw_config_t *const config = self->config;
    if ((frame->id != 266U && frame->id != 298U) || frame->dlc != config->setpoint_dlc) {
        oracle_break(self, now_us, 801, "frame 0x%X with %u bytes was sent", frame->id, frame->dlc);
    }
    if (!config->setpoint_type_set || frame->data[0] != config->setpoint_type || config->listen_only) {
        oracle_break(self, now_us, 802, "type %u was sent", frame->data[0]);
    }
    if (config->track_mm == 0U && word(&frame->data[1]) != 0) {
        oracle_break(self, now_us, 824, "%d mm/s although the track is not set", word(&frame->data[1]));
    }
    for (unsigned i = 5; i < frame->dlc; i++) {
        if (frame->data[i] != 0U) {
            oracle_break(self, now_us, 803, "padding is not zero");
        }
    }
    if (abs(word(&frame->data[1])) > config->max_speed_mm_s || abs(word(&frame->data[3])) > config->max_current_mA) {
        oracle_break(self, now_us, 804, "beyond the configured maximum: %d mm/s %d mA", word(&frame->data[1]),
                     word(&frame->data[3]));
    }
    if (config->current_role == IW_ROLE_LIMIT && word(&frame->data[3]) < 0) {
        oracle_break(self, now_us, 805, "a negative current limit");
    }
}

static int64_t slope_allows(const oracle_t *self, iw_time_us_t span_us, bool towards_zero) {
    const iw_config_t *const config = self->config;
    const iw_time_us_t granted_us = oracle_us(2U * config->period_ms);
    const iw_time_us_t span = (!towards_zero && span_us > granted_us) ? granted_us : span_us;
    const iw_time_us_t capped = (span > 1000000U) ? 1000000U : span;
    return (int64_t)(towards_zero ? config->decel_mm_s2 : config->accel_mm_s2) * (int64_t)capped;
}

static void judge_change(oracle_t *self, iw_time_us_t now_us, const oracle_wheel_t *wheel, int32_t speed,
                         int32_t current) {
    const iw_time_us_t span_us = (wheel->tried_us == IW_NEVER) ? 0U : now_us - wheel->tried_us;
    const bool braking = abs(speed) < abs(wheel->speed);
    const int64_t way = llabs((int64_t)abs(speed) - abs(wheel->speed));
    if ((speed < 0) != (wheel->speed < 0) && speed != 0 && wheel->speed != 0) {
        oracle_break(self, now_us, 806, "sign changed without a zero: %d to %d mm/s", wheel->speed, speed);
    }
    if (way > slope_allows(self, span_us, braking) / 1000000 + 1) {
        oracle_break(self, now_us, 807, "too steep: %d to %d mm/s within %llu us", wheel->speed, speed,
                     (unsigned long long)span_us);
    }
    if (self->config->current_role == IW_ROLE_SETPOINT) {
        const bool less = abs(current) < abs(wheel->current);
        const int64_t change = llabs((int64_t)abs(current) - abs(wheel->current));
        const int64_t share =
            slope_allows(self, span_us, less) * self->config->max_current_mA / self->config->max_speed_mm_s / 1000000;
        if (change > share + 2 || ((current < 0) != (wheel->current < 0) && current != 0 && wheel->current != 0)) {
            oracle_break(self, now_us, 808, "current too steep: %d to %d mA", wheel->current, current);
        }
    }
    // A setpoint is late 100 ms after it was due: at most a period after the last pair, plus the wait for an echo.
    if (span_us >= GAP_US + oracle_us(self->config->period_ms) + oracle_us(self->config->echo_ms)) {
        oracle_break(self, now_us, 401, "not zero after a gap of %llu us", (unsigned long long)span_us);
    }
}

static iw_time_us_t ramp_span_us(const oracle_t *self) {
    const iw_config_t *const config = self->config;
    return (iw_time_us_t)config->max_speed_mm_s * 1000000U / config->decel_mm_s2 + oracle_us(config->period_ms) + MS;
}

/// Judges whether a nonzero setpoint may be sent at all, and with this speed and current.
static void judge_permission(oracle_t *self, iw_time_us_t now_us, size_t side, int32_t speed, int32_t current) {
    const oracle_wheel_t *const wheel = &self->wheel[side];
    if (self->hard) {
        oracle_break(self, now_us, 201, "%d mm/s %d mA after a stop without ramp and without a new arm", speed,
                     current);
        return;
    }
    if (self->armed && now_us >= self->lease_until_us && self->ramp_us == IW_NEVER) {
        self->ramp_us = self->lease_until_us;
    }
    if (self->ramp_us != IW_NEVER) {
        if (now_us > self->ramp_us + ramp_span_us(self)) {
            oracle_break(self, now_us, 101, "%d mm/s %d mA %llu us after the permission ended", speed, current,
                         (unsigned long long)(now_us - self->ramp_us));
        }
        if (abs(speed) > abs(wheel->speed) ||
            (self->config->current_role == IW_ROLE_SETPOINT && abs(current) > abs(wheel->current))) {
            oracle_break(self, now_us, 102, "faster although the permission ended: %d to %d mm/s", wheel->speed, speed);
        }
        return;
    }
    if (!self->armed || !self->fresh) {
        oracle_break(self, now_us, 301, "%d mm/s %d mA without a fresh command", speed, current);
        return;
    }
    const int32_t sign = self->config->invert[side] ? -1 : 1;
    const int32_t wanted = self->target.wheel[side].speed_mm_s * sign;
    const int32_t current_wanted = self->target.wheel[side].current_mA * sign;
    const int32_t highest = (abs(wheel->speed) > abs(wanted)) ? abs(wheel->speed) : abs(wanted);
    if (abs(speed) > highest || (speed != 0 && wheel->speed == 0 && (speed > 0) != (wanted > 0))) {
        oracle_break(self, now_us, 302, "%d mm/s although %d mm/s were wanted", speed, wanted);
    }
    if (self->config->current_role == IW_ROLE_SETPOINT && current != 0 && wheel->current == 0 &&
        (current > 0) != (current_wanted > 0)) {
        oracle_break(self, now_us, 306, "%d mA although %d mA were wanted", current, current_wanted);
    }
}

static void judge_state(oracle_t *self, iw_time_us_t now_us, bool zero, int32_t current) {
    const iw_state_t state = iw_gateway_state(self->gateway);
    const bool limit = self->config->current_role == IW_ROLE_LIMIT;
    if (state == IW_STATE_LISTENING && !iw_gateway_arming(self->gateway)) {
        oracle_break(self, now_us, 501, "sent while LISTENING");
    }
    if (state == IW_STATE_LATCHED && self->state != IW_STATE_LATCHED && self->state == IW_STATE_LISTENING &&
        !self->was_arming) {
        oracle_break(self, now_us, 502, "sent on latching from LISTENING");
    }
    if (state == IW_STATE_LATCHED && self->state == IW_STATE_LATCHED &&
        (self->latched_silent ||
         (!self->hold_active && !self->estop_new && zeros_are_over(self, now_us, self->held_us, oracle_us(100))))) {
        oracle_break(self, now_us, 503, "sent while LATCHED, after the last zero");
    }
    if (self->hard && zero && limit && current != self->config->max_current_mA) {
        oracle_break(self, now_us, 203, "a stop with a limit of %d mA", current);
    }
    if (self->bus < IW_BUS_PASSIVE) {
        oracle_break(self, now_us, 504, "sent while the bus is down or off");
    }
}

static bool is_zero(const oracle_t *self, const iw_can_frame_t *frame) {
    return word(&frame->data[1]) == 0 && (word(&frame->data[3]) == 0 || self->config->current_role == IW_ROLE_LIMIT);
}

void oracle_call(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frames, uint32_t count) {
    if (count == IW_SIDES && frames[0].id == 266U && frames[1].id == 298U) {
        return;
    }
    if (count != 1U) {
        oracle_break(self, now_us, 608, "a call of %u frames that is no pair", (unsigned)count);
        return;
    }
    const oracle_wheel_t *const other = &self->wheel[(frames[0].id == 298U) ? IW_LEFT : IW_RIGHT];
    if (!is_zero(self, &frames[0])) {
        oracle_break(self, now_us, 608, "%d mm/s for one wheel in a separate call", word(&frames[0].data[1]));
    }
    if (other->pending == 0U && !other->tried_now) {
        oracle_break(self, now_us, 609, "a zero for one wheel and none for the other, which has no pending echo");
    }
}

void oracle_sent(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame, bool accepted) {
    const size_t side = (frame->id == 298U) ? IW_RIGHT : IW_LEFT;
    oracle_wheel_t *const wheel = &self->wheel[side];
    const int32_t speed = word(&frame->data[1]);
    const int32_t current = word(&frame->data[3]);
    const bool zero = is_zero(self, frame);
    judge_form(self, now_us, frame);
    judge_state(self, now_us, zero, current);
    oracle_judge_limit(self, now_us, side, &(iw_command_t){(int16_t)speed, (int16_t)current});
    if (!zero) {
        judge_permission(self, now_us, side, speed, current);
        judge_change(self, now_us, wheel, speed, current);
        if (self->broken_pair) {
            oracle_break(self, now_us, 601, "%d mm/s although the last pair did not leave whole", speed);
        }
        if (wheel->pending >= 1U) {
            oracle_break(self, now_us, 602, "%d mm/s behind a frame that was not echoed", speed);
        }
    }
    if (wheel->pending >= 2U) {
        oracle_break(self, now_us, 603, "a third frame behind two that were not echoed");
    }
    wheel->tried_us = now_us;
    wheel->tried_now = true;
    wheel->speed = accepted ? speed : 0;
    wheel->current = accepted ? current : 0;
    if (accepted) {
        wheel->accepted_now = true;
        wheel->accepted_zero = zero;
        wheel->sent_us = now_us;
        wheel->waiting[wheel->pending & 7U] = now_us;
        wheel->pending = (uint8_t)((wheel->pending < 7U) ? wheel->pending + 1U : 7U);
    } else {
        self->refused_us = now_us;
    }
}

/// Nothing may be sent after the last zero: after it, the next step purges each setpoint that is not echoed in time.
static void judge_silence(oracle_t *self, iw_time_us_t now_us, iw_time_us_t handed_us) {
    const iw_time_us_t given_us = oracle_us(self->config->echo_ms) + oracle_us(self->config->period_ms) + 10U * MS;
    const bool runs = now_us - self->step_us < oracle_us(self->config->period_ms) + 10U * MS &&
                      now_us - self->late_us > given_us && self->received < DRAIN;
    if (self->purges && runs && oracle_elapsed(now_us, self->silent_us, given_us)) {
        oracle_break(self, now_us, 607,
                     "a setpoint of %llu us ago came out after the last zero although the port purges",
                     (unsigned long long)(now_us - handed_us));
    }
}

void oracle_on_bus(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame, iw_time_us_t handed_us) {
    oracle_wheel_t *const wheel = &self->wheel[(frame->id == 298U) ? IW_RIGHT : IW_LEFT];
    const int32_t speed = word(&frame->data[1]);
    const bool zero = speed == 0 && (self->config->current_role == IW_ROLE_LIMIT || word(&frame->data[3]) == 0);
    if (!self->proven) {
        return;
    }
    judge_silence(self, now_us, handed_us);
    if (!zero && wheel->after_stale) {
        oracle_break(self, now_us, 604, "%d mm/s directly after an old frame", speed);
    }
    wheel->after_stale = false;
    if (!zero && !self->armed && self->edge_us != 0U && self->hard && ++wheel->old_on_bus > 1U) {
        oracle_break(self, now_us, 202, "a second nonzero frame on the bus after the e-stop");
    }
    if (!zero && now_us - handed_us > oracle_us(300) && now_us - self->late_us > oracle_us(300)) {
        wheel->after_stale = true;
        if (self->purges && now_us - self->step_us < GAP_US) {
            oracle_break(self, now_us, 605, "a frame of %llu us ago came out although the port purges",
                         (unsigned long long)(now_us - handed_us));
        }
    }
}

// ---- consequences ----------------------------------------------------------------------------------------------

static void judge_armed(oracle_t *self, iw_time_us_t now_us) {
    if (self->armed) {
        if (self->ramp_us != IW_NEVER) {
            oracle_break(self, now_us, 103, "still ARMED after the permission ended");
        }
        return;
    }
    if (self->pending_arm == IW_CLIENT_NONE) {
        oracle_break(self, now_us, 304, "ARMED although no client may be");
        return;
    }
    if (self->wheel[IW_LEFT].proven_us < self->arm_us || self->wheel[IW_RIGHT].proven_us < self->arm_us) {
        oracle_break(self, now_us, 305, "ARMED before both zeros were echoed");
    }
    self->armed = true;
    self->fresh = false;
    self->hard = false;
    self->edge_us = 0;
    self->wheel[IW_LEFT].old_on_bus = self->wheel[IW_RIGHT].old_on_bus = 0;
    self->ramp_us = IW_NEVER;
    self->holder = self->pending_arm;
    self->pending_arm = IW_CLIENT_NONE;
    self->armed_us = now_us;
    self->lease_until_us = now_us + FIRST_LEASE_US;
}

bool oracle_rested(const oracle_t *self, iw_time_us_t now_us, iw_time_us_t span_us) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        const oracle_wheel_t *const wheel = &self->wheel[side];
        if (wheel->fresh_us == IW_NEVER ||
            oracle_elapsed(now_us, wheel->fresh_us, oracle_us(self->config->wheel_silent_ms)) ||
            !oracle_elapsed(now_us, wheel->rest_us, span_us)) {
            return false;
        }
    }
    return true;
}

/// A client that arms from here on sends again. A pair of this microsecond may be its first: proof counts by the time of sending.
static void forget_sent(oracle_t *self, iw_time_us_t now_us) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        if (self->wheel[side].sent_us < now_us) {
            self->wheel[side].sent_us = IW_NEVER;
        }
    }
}

/// Latches after the common ramp: one wheel offline, or the pair diverges for the third time.
static bool latches_with_a_ramp(const oracle_t *self) {
    const iw_stop_t *const stop = &self->gateway->permit.stop;
    const bool one = stop->sides == IW_SIDES_LEFT || stop->sides == IW_SIDES_RIGHT;
    return one && (stop->cause == IW_CAUSE_WHEEL_LOST || stop->cause == IW_CAUSE_PAIR_DIVERGES);
}

/// Only an e-stop that begins makes a new stop of a latch.
static void judge_latched_again(oracle_t *self, iw_time_us_t now_us) {
    const uint32_t stops = self->gateway->permit.stop.number - self->latch_stop;
    const uint32_t estops = self->estop_new ? 1U : 0U;
    if (stops != estops) {
        oracle_break(self, now_us, 208, "%u stops in one latch for %u new e-stops", (unsigned)stops, (unsigned)estops);
    }
}

static void begin_latch(oracle_t *self, iw_time_us_t now_us) {
    self->latched_us = self->held_us = now_us;
    self->latched_silent = self->state == IW_STATE_LISTENING && !self->was_arming;
    oracle_hold_latched(self, now_us);
    if (latches_with_a_ramp(self)) {
        oracle_soft_stop(self, now_us);
    } else {
        oracle_hard_stop(self);
    }
}

/// The public state has changed, or may have: called after every step and every request.
void oracle_observe(oracle_t *self, iw_time_us_t now_us) {
    const iw_state_t state = iw_gateway_state(self->gateway);
    if (state == IW_STATE_ARMED) {
        judge_armed(self, now_us);
    } else if (self->armed) {
        oracle_soft_stop(self, now_us);
    }
    if (state == IW_STATE_LATCHED && self->state == IW_STATE_LATCHED) {
        judge_latched_again(self, now_us);
    } else if (state == IW_STATE_LATCHED) {
        begin_latch(self, now_us);
    }
    self->estop_new = false;
    self->latch_stop = self->gateway->permit.stop.number;
    oracle_judge_hold_state(self, now_us, state);
    if (state == IW_STATE_STOPPING && self->state != IW_STATE_STOPPING) {
        // A reset that does not end the hold does not change its time.
        self->stopped_us = (self->state == IW_STATE_LATCHED) ? self->held_us : now_us;
    }
    if (state == IW_STATE_LISTENING && self->state == IW_STATE_ARMED) {
        oracle_break(self, now_us, 505, "from ARMED to LISTENING without STOPPING");
    }
    if (state == IW_STATE_LISTENING && self->state == IW_STATE_STOPPING && !self->restarting) {
        if (!oracle_elapsed(now_us, self->stopped_us, oracle_us(self->config->zero_hold_ms)) ||
            (!oracle_rested(self, now_us, SETTLED_US) &&
             !oracle_elapsed(now_us, self->stopped_us, oracle_hold_max_us(self, self->stopped_us)))) {
            oracle_break(self, now_us, 506, "silent too early, %llu us after the stop",
                         (unsigned long long)(now_us - self->stopped_us));
        }
    }
    // A request before the first step after a stall finds the earlier state.
    if (state == IW_STATE_STOPPING && !self->hold_active && now_us - self->released_us > oracle_us(1000) &&
        zeros_are_over(self, now_us, self->stopped_us, oracle_us(1300)) && now_us - self->late_us > oracle_us(1000) &&
        now_us - self->step_us < GAP_US) {
        oracle_break(self, now_us, 507, "STOPPING without end");
    }
    if (state == IW_STATE_LISTENING && !iw_gateway_arming(self->gateway)) {
        forget_sent(self, now_us);
    }
    // The dead process may have left two setpoints of each wheel in its controller.
    const bool other = self->foreign > 4U;
    if (self->restarting && state == IW_STATE_LISTENING && !other &&
        !oracle_elapsed(now_us, self->stopped_us, oracle_us(self->config->zero_hold_ms))) {
        oracle_break(self, now_us, 510, "silent too early after a restart");
    }
    self->restarting = self->restarting && state == IW_STATE_STOPPING;
    self->state = state;
    self->was_arming = iw_gateway_arming(self->gateway);
    if (!self->was_arming) {
        self->pending_arm = IW_CLIENT_NONE;
    }
}
