// SPDX-License-Identifier: MIT
// The consequences that a step must have: latches, wheels, gaps, whole pairs.
#include "oracle_parts.h"

#include <stdlib.h>

/// An echo that takes longer than this shows that the bus does not accept frames in time.
#define SLOW_ECHO_US (20U * MS)
/// Additional time for a condition that must last: the core compares a step later, and a loop that is 100 ms late stops.
#define MARGIN_US (100U * MS)
/// A step this long after the last one was late: the wheels have not been compared meanwhile.
#define LATE_STEP_US (60U * MS)

static bool sending_state(iw_state_t state) {
    return state == IW_STATE_ARMED || state == IW_STATE_STOPPING;
}

static void judge_latches(oracle_t *self, iw_time_us_t now_us, iw_state_t before) {
    const iw_state_t state = iw_gateway_state(self->gateway);
    const bool sending = sending_state(before) && !self->restarting;
    if (self->estop != 0 && state != IW_STATE_LATCHED) {
        oracle_break(self, now_us, 204, "not LATCHED although the e-stop is pressed");
    }
    const iw_cause_t cause = (self->estop == IW_ESTOP_DISAGREES) ? IW_CAUSE_ESTOP_DISAGREES : IW_CAUSE_ESTOP_LINE;
    if (self->estop != 0 && before != IW_STATE_LATCHED && self->gateway->permit.stop.cause != cause) {
        oracle_break(self, now_us, 205, "the e-stop is not reported as the cause");
    }
    if (sending && self->bus < IW_BUS_PASSIVE && state != IW_STATE_LATCHED) {
        oracle_break(self, now_us, 701, "not LATCHED although the bus is down or off");
    }
    if (sending && self->foreign_now && state != IW_STATE_LATCHED) {
        oracle_break(self, now_us, 702, "not LATCHED although there is a second master");
    }
    if (sending && self->hung && state != IW_STATE_LATCHED) {
        oracle_break(self, now_us, 703, "not LATCHED although the loop hung");
    }
    if (sending && self->late_stop && state == IW_STATE_ARMED) {
        oracle_break(self, now_us, 704, "still ARMED although the loop was late");
    }
    if (sending && self->jump_now && state != IW_STATE_LATCHED) {
        oracle_break(self, now_us, 705, "not LATCHED although the odometry jumped");
    }
    if (sending && self->back_now && state != IW_STATE_LATCHED) {
        oracle_break(self, now_us, 711, "not LATCHED although offset frames came back");
    }
}

/// Offset frames without a pause are no reboot, however long they come.
static void judge_reboot(oracle_t *self, iw_time_us_t now_us) {
    const iw_stop_t *const stop = &self->gateway->permit.stop;
    if (stop->number != self->stops && stop->cause == IW_CAUSE_WHEEL_REBOOTED &&
        stop->detail == IW_REBOOT_OFFSET_FRAMES && !self->may_be_back) {
        oracle_break(self, now_us, 712, "stopped for offset frames that had never stopped");
    }
    self->stops = stop->number;
    for (size_t side = 0; side < IW_SIDES; side++) {
        oracle_wheel_t *const wheel = &self->wheel[side];
        // The pause of its offset frames restarts in the step that finds the reboot, not with the next frame.
        wheel->offset_us = (wheel->reboots != self->gateway->wheel[side].reboots) ? now_us : wheel->offset_us;
        wheel->reboots = self->gateway->wheel[side].reboots;
    }
}

static bool since(iw_time_us_t *since_us, iw_time_us_t now_us, bool condition, uint32_t span_ms) {
    if (!condition) {
        *since_us = IW_NEVER;
    } else if (*since_us == IW_NEVER) {
        *since_us = now_us;
    }
    return oracle_elapsed(now_us, *since_us, oracle_us(span_ms) + MARGIN_US);
}

static void judge_following(oracle_t *self, iw_time_us_t now_us, size_t side, bool comparable) {
    oracle_wheel_t *const wheel = &self->wheel[side];
    const int32_t commanded = wheel->speed;
    const int32_t measured = (int32_t)((int64_t)wheel->rpm * 20106 / 1000);
    const bool against = comparable && abs(commanded) > 105 && abs(measured) > 105 && (commanded > 0) != (measured > 0);
    const int32_t most = (abs(commanded) > abs(wheel->before)) ? abs(commanded) : abs(wheel->before);
    const bool faster = comparable && abs(measured) - most > self->config->follow_mm_s + 25;
    const bool blocked = comparable && abs(commanded) >= 100 && abs(measured) * 5 + 100 < abs(commanded) &&
                         iw_gateway_state(self->gateway) == IW_STATE_ARMED;
    if (since(&wheel->against_us, now_us, against, 300)) {
        oracle_break(self, now_us, 706, "not LATCHED although a wheel turns against its command");
    }
    if (since(&wheel->faster_us, now_us, faster, self->config->follow_ms)) {
        oracle_break(self, now_us, 707, "not LATCHED although a wheel is too fast: %d instead of %d mm/s", measured,
                     commanded);
    }
    if (since(&wheel->blocked_us, now_us, blocked, self->config->blocked_ms)) {
        oracle_break(self, now_us, 708, "still ARMED although a wheel is blocked");
    }
}

/// A distance beyond any doubt: twice the limit, plus the sum of all lags when both wheels reverse.
static int64_t far_away_nm(const oracle_t *self) {
    const int64_t lags_ms = 60 + 2 * (int64_t)self->config->wheel_silent_ms + 2 * (int64_t)self->config->period_ms;
    return 2 * (int64_t)self->config->pair_mm * 1000000 + 2 * (int64_t)self->config->max_speed_mm_s * lags_ms * 1000;
}

/// Difference of measured and commanded speed, in the machine's frame, for 192 mm as in setpoints.
static int64_t difference_um_s(const oracle_t *self, size_t side) {
    const oracle_wheel_t *const wheel = &self->wheel[side];
    const int64_t away = (int64_t)wheel->rpm * 20106 - (int64_t)wheel->speed * 1000;
    return self->config->invert[side] ? -away : away;
}

/// A machine that turns on its own: judged without any lag, so only at a large distance. A late step adds nothing to the
/// distance and removes nothing.
static void judge_pair_path(oracle_t *self, iw_time_us_t now_us, bool comparable, bool late) {
    const int64_t elapsed_us = (int64_t)(now_us - self->path_at_us);
    self->path_at_us = now_us;
    if (!comparable && late) {
        return;
    }
    if (!comparable || elapsed_us > (int64_t)LATE_STEP_US) {
        self->path_nm = 0;
        return;
    }
    const int64_t leak_us = (int64_t)self->config->pair_leak_ms * (int64_t)MS;
    const int64_t away = difference_um_s(self, IW_RIGHT) - difference_um_s(self, IW_LEFT);
    self->path_nm += away * elapsed_us / 1000 - self->path_nm * elapsed_us / leak_us;
    if (llabs(self->path_nm) > far_away_nm(self) && iw_gateway_state(self->gateway) == IW_STATE_ARMED) {
        oracle_break(self, now_us, 713, "still ARMED although the pair left its path by %lld mm",
                     (long long)(self->path_nm / 1000000));
    }
}

static void judge_wheels(oracle_t *self, iw_time_us_t now_us) {
    const bool ours = sending_state(iw_gateway_state(self->gateway)) && !self->restarting;
    unsigned offline = 0;
    bool comparable = ours && !self->stalled;
    for (size_t side = 0; side < IW_SIDES; side++) {
        oracle_wheel_t *const wheel = &self->wheel[side];
        const iw_time_us_t received_us =
            (wheel->fresh_us == IW_NEVER || wheel->fresh_us < wheel->excused_us) ? wheel->excused_us : wheel->fresh_us;
        const iw_time_us_t silent_us = oracle_us(self->config->wheel_silent_ms);
        const bool silent = now_us - received_us >= silent_us;
        // An excused wheel is not online: its motion is known again with its next frame of known age.
        const bool known = wheel->fresh_us != IW_NEVER && !oracle_elapsed(now_us, wheel->fresh_us, silent_us);
        comparable = comparable && known;
        offline += silent ? 1U : 0U;
        if (!ours || silent || (known && !self->stalled)) { // Otherwise the next step on time decides.
            judge_following(self, now_us, side, ours && known);
        }
        if (!ours || self->stalled) {
            continue;
        }
        if (silent) {
            oracle_break(self, now_us, 709, "not LATCHED although a wheel was offline for %llu us",
                         (unsigned long long)(now_us - received_us));
        }
        if (wheel->pending > 0U && now_us - wheel->waiting[0] >= oracle_us(self->config->echo_ms)) {
            oracle_break(self, now_us, 710, "not LATCHED although a frame was not echoed for %llu us",
                         (unsigned long long)(now_us - wheel->waiting[0]));
        }
    }
    judge_pair_path(self, now_us, comparable, ours && offline == 0U);
    // One offline wheel may ramp; with both offline only zero may follow.
    if (offline == IW_SIDES && !self->stalled) {
        oracle_hard_stop(self);
    }
}

/// Zeros are held from the end of the ramp, as reported to all clients: iw_snapshot_t::output_zero.
static void note_hold(oracle_t *self, iw_time_us_t now_us) {
    iw_snapshot_t seen;
    if (self->state != IW_STATE_LATCHED || self->latched_silent) {
        return;
    }
    iw_gateway_snapshot(self->gateway, now_us, &seen);
    if (!seen.output_zero) {
        self->held_us = now_us;
    }
}

/// While the process runs and the bus accepts frames, setpoints come without a gap.
static void judge_gaps(oracle_t *self, iw_time_us_t now_us) {
    const iw_state_t state = iw_gateway_state(self->gateway);
    const bool holding = oracle_holds(self) || (state == IW_STATE_LATCHED && !self->latched_silent &&
                                                now_us - self->latched_us < oracle_us(self->config->zero_hold_ms));
    for (size_t side = 0; side < IW_SIDES; side++) {
        if (self->wheel[side].pending > 0U && now_us - self->wheel[side].waiting[0] >= SLOW_ECHO_US) {
            self->refused_us = now_us;
        }
    }
    const bool excused = now_us - self->late_us < GAP_US || now_us - self->bus_bad_us < GAP_US ||
                         (self->refused_us != IW_NEVER && now_us - self->refused_us < GAP_US);
    for (size_t side = 0; side < IW_SIDES; side++) {
        const oracle_wheel_t *const wheel = &self->wheel[side];
        const bool must = sending_state(state) || holding;
        if (must && !excused && (wheel->sent_us == IW_NEVER || now_us - wheel->sent_us >= GAP_US)) {
            oracle_break(self, now_us, 402, "no setpoint for 100 ms");
        }
    }
}

static void judge_pair(oracle_t *self, iw_time_us_t now_us) {
    const oracle_wheel_t *const left = &self->wheel[IW_LEFT];
    const oracle_wheel_t *const right = &self->wheel[IW_RIGHT];
    const bool moving = (left->accepted_now && !left->accepted_zero) || (right->accepted_now && !right->accepted_zero);
    if (moving && (!left->tried_now || !right->tried_now)) {
        oracle_break(self, now_us, 606, "one setpoint without the other");
    }
    if (moving && left->accepted_now != right->accepted_now) {
        self->broken_pair = true;
    } else if (left->accepted_zero && right->accepted_zero) {
        self->broken_pair = false;
    }
}

/// After the e-stop the first zero is sent in the step that reads it.
static void judge_estop_zero(oracle_t *self, iw_time_us_t now_us, iw_state_t before) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        const oracle_wheel_t *const wheel = &self->wheel[side];
        const bool first = self->estop != 0 && (before == IW_STATE_ARMED || !wheel->accepted_zero);
        if (first && sending_state(before) && self->bus >= IW_BUS_PASSIVE && !wheel->tried_now && wheel->pending < 2U) {
            oracle_break(self, now_us, 206, "no zero immediately after the e-stop");
        }
    }
}

/// Zeros end by the rules; in LATCHED the state does not show it. Judged per step, because the wheels may be lost between two.
static void watch_silence(oracle_t *self, iw_time_us_t now_us) {
    const iw_state_t state = iw_gateway_state(self->gateway);
    const bool listening = state == IW_STATE_LISTENING && !iw_gateway_arming(self->gateway);
    const bool silent = self->silent_us != IW_NEVER && self->silent_us > self->latched_us;
    const bool ramped = self->held_us != self->latched_us;
    self->unsettled_us = (oracle_holds(self) && !oracle_rested(self, now_us, SETTLED_US)) ? now_us : self->unsettled_us;
    const iw_time_us_t since_us = oracle_zeros_from(self, self->held_us);
    const iw_time_us_t zeros_us = since_us + (ramped ? oracle_us(self->config->period_ms) + SLOW_ECHO_US : 0U);
    const bool held = now_us > zeros_us && oracle_elapsed(now_us, zeros_us, oracle_us(self->config->zero_hold_ms));
    const bool ended =
        (held && oracle_rested(self, now_us, SETTLED_US)) ||
        (now_us > zeros_us && oracle_elapsed(now_us, zeros_us, oracle_hold_max_us(self, since_us) + oracle_us(100)));
    if (listening ||
        (state == IW_STATE_LATCHED && (self->latched_silent || (!self->hold_active && (ended || silent))))) {
        self->silent_us = (self->silent_us == IW_NEVER) ? now_us : self->silent_us;
    } else {
        self->silent_us = IW_NEVER;
    }
}

void oracle_step_end(oracle_t *self, iw_time_us_t now_us) {
    const iw_state_t before = self->state;
    judge_latches(self, now_us, before);
    oracle_judge_contacts(self, now_us);
    judge_reboot(self, now_us);
    if (self->armed && now_us >= self->lease_until_us) {
        oracle_soft_stop(self, self->lease_until_us);
    }
    if (before == IW_STATE_LATCHED && iw_gateway_state(self->gateway) != IW_STATE_LATCHED) {
        oracle_break(self, now_us, 508, "no longer LATCHED although no client requested a reset");
    }
    oracle_observe(self, now_us);
    note_hold(self, now_us);
    watch_silence(self, now_us);
    judge_wheels(self, now_us);
    judge_gaps(self, now_us);
    judge_pair(self, now_us);
    oracle_judge_turn(self, now_us);
    judge_estop_zero(self, now_us, before);
    oracle_judge_rolling(self, now_us);
    oracle_judge_hold(self, now_us);
    self->step_us = now_us;
    self->timing_bad = self->gateway->facts.timing_contradicted;
}
