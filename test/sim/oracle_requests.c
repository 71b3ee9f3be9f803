// SPDX-License-Identifier: MIT
#include "oracle_parts.h"

#include <stdlib.h>

/// A step that is late by this much stops the wheels before anything else.
#define US_LATE (100U * MS)

static void judge_start(oracle_t *self, iw_time_us_t now_us, uint32_t rule, const char *what) {
    if (self->estop != 0) {
        oracle_break(self, now_us, rule, "%s although the e-stop was pressed", what);
    }
    if (self->bus < IW_BUS_PASSIVE) {
        oracle_break(self, now_us, rule + 1U, "%s although the bus was down or off", what);
    }
    if (self->foreign_us != IW_NEVER && !oracle_elapsed(now_us, self->foreign_us, EVENT_US)) {
        oracle_break(self, now_us, rule + 2U, "%s although there was a second master", what);
    }
    if (self->nonzero_drive_us != IW_NEVER && !oracle_elapsed(now_us, self->nonzero_drive_us, STALE_US)) {
        oracle_break(self, now_us, rule + 3U, "%s although a client was sending commands", what);
    }
    for (size_t side = 0; side < IW_SIDES; side++) {
        const oracle_wheel_t *const wheel = &self->wheel[side];
        // Input of the last step: a request may come before the next one.
        const iw_time_us_t seen_us = self->step_us;
        if (wheel->fresh_us == IW_NEVER ||
            oracle_elapsed(seen_us, wheel->fresh_us, oracle_us(self->config->wheel_silent_ms))) {
            oracle_break(self, now_us, rule + 4U, "%s although a wheel was offline", what);
        }
        if (!oracle_elapsed(seen_us, wheel->rest_us, oracle_us(self->config->rest_ms))) {
            oracle_break(self, now_us, rule + 5U, "%s although a wheel was not at standstill", what);
        }
    }
}

void oracle_arm(oracle_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover, iw_refusal_t result) {
    const bool already = client == self->holder || client == self->pending_arm;
    if (result == IW_REFUSE_NONE && !already) {
        judge_start(self, now_us, 310, "armed");
        if (self->state == IW_STATE_LATCHED) {
            oracle_break(self, now_us, 320, "armed although LATCHED");
        }
        if ((self->holder != IW_CLIENT_NONE || self->pending_arm != IW_CLIENT_NONE) && !takeover) {
            oracle_break(self, now_us, 321, "armed although another client holds the lease");
        }
        // For a request before the first step after a stall, the late stop comes first.
        if (now_us - self->step_us < US_LATE && (self->wheel[IW_LEFT].speed != 0 || self->wheel[IW_RIGHT].speed != 0)) {
            oracle_break(self, now_us, 322, "armed although the outputs are not zero");
        }
        if (self->timing_bad) {
            oracle_break(self, now_us, 323, "armed although the bus timing is contradicted");
        }
        if (self->config->track_mm == 0U) {
            oracle_break(self, now_us, 325, "armed although the track is not set");
        }
        if (self->armed) {
            self->holder = client;
            self->fresh = false;
            self->armed_us = now_us;
            self->lease_until_us = now_us + FIRST_LEASE_US;
        } else {
            self->pending_arm = client;
            self->arm_us = now_us;
            oracle_hold_asked(self);
        }
    }
    oracle_observe(self, now_us);
}

/// No limit makes a wheel faster than requested, changes its sign, or moves a wheel whose command is 0.
static bool is_beyond(int32_t applied, int32_t asked) {
    return abs(applied) > abs(asked) || (applied != 0 && (applied < 0) != (asked < 0));
}

static void judge_applied(oracle_t *self, iw_time_us_t now_us, const iw_drive_t *request, const iw_applied_t *applied) {
    const int32_t left = applied->pair.wheel[IW_LEFT].speed_mm_s;
    const int32_t right = applied->pair.wheel[IW_RIGHT].speed_mm_s;
    const int32_t *const asked = request->speed_mm_s;
    const int64_t largest = (abs(asked[0]) > abs(asked[1])) ? abs(asked[0]) : abs(asked[1]);
    const int64_t skew = (int64_t)left * asked[1] - (int64_t)right * asked[0];
    const bool within =
        largest <= self->config->max_speed_mm_s && !oracle_turns_too_fast(self, asked[IW_LEFT], asked[IW_RIGHT]);
    const bool slowed = left != asked[IW_LEFT] || right != asked[IW_RIGHT];
    if (oracle_turns_too_fast(self, left, right)) {
        oracle_break(self, now_us, 337, "asked for %d %d mm/s, applied %d %d: turns too fast", asked[0], asked[1], left,
                     right);
    }
    if (slowed && !applied->limited) {
        oracle_break(self, now_us, 338, "requested %d %d mm/s, applied %d %d, not reported as limited", asked[0],
                     asked[1], left, right);
    }
    if (is_beyond(left, asked[IW_LEFT]) || is_beyond(right, asked[IW_RIGHT])) {
        oracle_break(self, now_us, 339, "requested %d %d mm/s, applied %d %d: faster, or in the other direction",
                     asked[0], asked[1], left, right);
    }
    if (abs(left) > self->config->max_speed_mm_s || abs(right) > self->config->max_speed_mm_s ||
        llabs(skew) > 2 * largest || (within && slowed)) {
        oracle_break(self, now_us, 330, "asked for %d %d mm/s, applied %d %d", asked[0], asked[1], left, right);
    }
}

void oracle_drive(oracle_t *self, const oracle_asked_t *asked, const iw_drive_t *request, iw_refusal_t result,
                  const iw_applied_t *applied) {
    const iw_time_us_t now_us = asked->now_us;
    const iw_time_us_t sent_us = asked->sent_us;
    const int32_t *const speed = request->speed_mm_s;
    const bool in_range = abs(speed[0]) <= INT16_MAX + 1 && abs(speed[1]) <= INT16_MAX + 1;
    const bool current = self->config->current_role == IW_ROLE_SETPOINT && request->has_current &&
                         (request->current_mA[0] != 0 || request->current_mA[1] != 0);
    if (result == IW_REFUSE_NONE) {
        if (!self->armed || asked->client != self->holder || self->ramp_us != IW_NEVER ||
            sent_us >= self->lease_until_us) {
            oracle_break(self, now_us, 331, "a drive was accepted without a lease");
        }
        if (sent_us < self->armed_us) {
            oracle_break(self, now_us, 333, "a drive from before the arm was accepted");
        }
        if (!in_range) {
            oracle_break(self, now_us, 332, "a drive out of range was accepted");
        }
        judge_applied(self, now_us, request, applied);
        oracle_judge_applied_limits(self, now_us, request, applied);
        // A late command, overtaken by a newer one, does not shorten its lease; the first one replaces the lease of the arm.
        const iw_time_us_t until_us = sent_us + oracle_us(self->config->lease_ms);
        self->lease_until_us = (self->fresh && self->lease_until_us > until_us) ? self->lease_until_us : until_us;
        self->fresh = true;
        self->target = applied->pair;
    }
    const bool newer = self->nonzero_drive_us == IW_NEVER || sent_us > self->nonzero_drive_us;
    if (newer && (speed[0] != 0 || speed[1] != 0 || current)) {
        self->nonzero_drive_us = sent_us;
    }
    oracle_observe(self, now_us);
}

void oracle_stop(oracle_t *self, iw_time_us_t now_us, bool matters) {
    if (matters) {
        oracle_soft_stop(self, now_us);
    }
    oracle_observe(self, now_us);
}

void oracle_shutdown(oracle_t *self, iw_time_us_t now_us) {
    self->released_us = now_us;
    self->ended = true;
    oracle_hold_ended(self);
}

void oracle_soft_estop(oracle_t *self, iw_time_us_t now_us) {
    oracle_hard_stop(self);
    oracle_note_estop(self, now_us, 1);
    if (iw_gateway_state(self->gateway) != IW_STATE_LATCHED) {
        oracle_break(self, now_us, 207, "not LATCHED after a software e-stop");
    }
    oracle_observe(self, now_us);
}

void oracle_reset(oracle_t *self, iw_time_us_t now_us, iw_state_t before, const iw_stop_t *stop) {
    if (before == IW_STATE_LATCHED && iw_gateway_state(self->gateway) != IW_STATE_LATCHED) {
        const bool event = stop->cause == IW_CAUSE_ESTOP_SOFTWARE || stop->cause == IW_CAUSE_WHEEL_REBOOTED ||
                           stop->cause == IW_CAUSE_FEEDBACK_SIGN || stop->cause == IW_CAUSE_OVERSPEED ||
                           stop->cause == IW_CAUSE_LOOP_HUNG;
        judge_start(self, now_us, 340, "reset");
        oracle_judge_quarrel(self, now_us);
        const iw_time_us_t seen_us = (stop->cause == IW_CAUSE_ESTOP_SOFTWARE) ? self->estop_us[1] : self->latched_us;
        if (event && !oracle_elapsed(now_us, seen_us, EVENT_US)) {
            oracle_break(self, now_us, 350, "reset although the cause was seen less than a second ago");
        }
    }
    oracle_observe(self, now_us);
}

void oracle_edge(oracle_t *self, iw_time_us_t now_us) {
    self->edge_us = now_us;
    self->wheel[IW_LEFT].old_on_bus = self->wheel[IW_RIGHT].old_on_bus = 0;
}

void oracle_fail(oracle_t *self, iw_time_us_t now_us, uint32_t rule, const char *text) {
    oracle_break(self, now_us, rule, "%s", text);
}
