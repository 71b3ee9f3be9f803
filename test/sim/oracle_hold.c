// SPDX-License-Identifier: MIT
// after_stop = hold: zeros after a stop or a latch have no end but release, arm, another master and the end of the process.
#include "oracle_parts.h"

/// A hold must be reported after this time: the ramp, the shortest hold and the previous step.
#define REPORT_US (4000U * MS)

void oracle_hold_asked(oracle_t *self) {
    self->hold_active = self->config->hold;
    self->hold_unsure = false;
    self->ended = false;
}

/// A client that released the zeros earlier did not know of the latch.
void oracle_hold_latched(oracle_t *self, iw_time_us_t now_us) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(self->gateway, now_us, &seen);
    self->hold_active = self->config->hold && !self->ended && self->foreign_us != now_us;
    if (self->hold_active && !self->latched_silent && !seen.holding) {
        oracle_break(self, now_us, 823, "latched while zeros were sent, and no hold is reported");
    }
}

void oracle_hold_ended(oracle_t *self) {
    self->hold_active = false;
    self->hold_unsure = false;
}

/// Frames that the dead process left in its controller do not end the hold; a second master does.
void oracle_hold_foreign(oracle_t *self) {
    if (self->restarting) {
        self->hold_unsure = true;
    } else {
        oracle_hold_ended(self);
    }
}

bool oracle_holds(const oracle_t *self) {
    const bool latched = self->state == IW_STATE_LATCHED && !self->latched_silent;
    return self->hold_active && !self->hold_unsure && (latched || self->state == IW_STATE_STOPPING);
}

void oracle_judge_hold_state(oracle_t *self, iw_time_us_t now_us, iw_state_t state) {
    if (state != IW_STATE_LISTENING || !oracle_holds(self)) {
        return;
    }
    if (self->restarting) {
        oracle_break(self, now_us, 822, "silent although the hold of the killed process must be resumed");
    } else {
        oracle_break(self, now_us, 818, "silent although zeros must be held");
    }
}

void oracle_judge_hold(oracle_t *self, iw_time_us_t now_us) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(self->gateway, now_us, &seen);
    const bool holds = oracle_holds(self);
    const iw_time_us_t since_us = (self->state == IW_STATE_LATCHED) ? self->held_us : self->stopped_us;
    if (seen.holding && !holds && !self->hold_unsure) {
        oracle_break(self, now_us, 821, "a hold is reported although it has ended or was never requested");
    }
    if (holds && !seen.holding && !seen.arming && oracle_elapsed(now_us, since_us, REPORT_US) &&
        now_us - self->late_us > REPORT_US) {
        oracle_break(self, now_us, 820, "zeros are to be held, and no hold is reported");
    }
    // The zeros for the dead process have become a hold of this process.
    if (self->restarting && self->hold_active &&
        oracle_elapsed(now_us, self->stopped_us, oracle_us(self->config->zero_hold_ms))) {
        self->restarting = false;
        self->hold_unsure = self->foreign_us == now_us;
    }
}

void oracle_release(oracle_t *self, iw_time_us_t now_us, iw_refusal_t result) {
    if (result == IW_REFUSE_NONE) {
        if (self->armed || iw_gateway_arming(self->gateway)) {
            oracle_break(self, now_us, 819, "released while a client drives or arms");
        }
        oracle_hold_ended(self);
        self->released_us = now_us;
    }
    oracle_observe(self, now_us);
}
