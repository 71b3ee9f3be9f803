// SPDX-License-Identifier: MIT
#include "learn_lag.h"
#include "text/ctl_text.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

/// After this time at one setpoint a wheel has reached it. Its speed is measured from then on, for the same time.
#define SETTLE_US 500000
/// Smaller changes are only a few steps of telemetry.
#define CHANGE_MIN_MM_S 300.0
/// A longer time without a speed frame is a gap.
#define GAP_US 100000
/// Minimum number of changes of one wheel for a value, and the maximum difference between them.
#define COUNT_MIN 2U
#define SPREAD_MS 30.0
/// Range of the configuration key.
#define LAG_MIN_MS 10
#define LAG_MAX_MS 300
/// The margins of the rule of the pair were computed for this range around its value (docs/user/pair.md).
#define RANGE_PERCENT 30

void learn_lag_init(learn_lag_t *self) {
    memset(self, 0, sizeof *self);
    self->commanded_us = self->measured_us = -1;
}

/// Discards the state of the wheel: it is not known.
static void forget(learn_lag_t *self) {
    self->changing = false;
    self->settled_us = 0;
    self->settled_mm = 0;
}

static void add_lag(learn_lag_t *self, double lag_ms) {
    if (self->count == 0U || lag_ms < self->least_ms) {
        self->least_ms = lag_ms;
    }
    if (self->count == 0U || lag_ms > self->most_ms) {
        self->most_ms = lag_ms;
    }
    self->sum_ms += lag_ms;
    self->count++;
}

/// Ends a change: the wheel has a steady speed again.
static void end_change(learn_lag_t *self) {
    const double commanded = self->commanded_mm_s - self->before_mm_s;
    const double measured = self->settled_mm / ((double)self->settled_us / 1e6) - self->before;
    self->changing = false;
    if (fabs(commanded) >= CHANGE_MIN_MM_S && measured / commanded > 0.5 && measured / commanded < 2.0) {
        add_lag(self, (self->way_commanded_mm / commanded - self->way_mm / measured) * 1000.0);
    }
}

/// Adds the time up to `to_us`, with the setpoint and the speed until then.
static void pass(learn_lag_t *self, int64_t from_us, int64_t to_us, double measured_mm_s) {
    const double span_s = (double)(to_us - from_us) / 1e6;
    const double way_mm = (self->measured_mm_s + measured_mm_s) / 2.0 * span_s;
    if (self->changing) {
        self->way_commanded_mm += (self->commanded_mm_s - self->before_mm_s) * span_s;
        self->way_mm += way_mm - self->before * span_s;
    }
    if (from_us - self->constant_us >= SETTLE_US) {
        self->settled_mm += way_mm;
        self->settled_us += to_us - from_us;
    }
    if (self->changing && self->settled_us >= SETTLE_US) {
        end_change(self);
    }
}

void learn_lag_receive(learn_lag_t *self, int64_t at_us, double speed_mm_s) {
    const int64_t gap_us = at_us - self->measured_us;
    const bool known = self->commanded_us >= 0 && at_us - self->commanded_us <= (int64_t)IW_WHEEL_WATCHDOG_US;
    if (self->measured_us < 0 || gap_us < 0 || gap_us > GAP_US || !known) {
        forget(self);
    } else {
        pass(self, self->measured_us, at_us, speed_mm_s);
    }
    self->measured_mm_s = speed_mm_s;
    self->measured_us = at_us;
}

void learn_lag_command(learn_lag_t *self, int64_t at_us, int32_t speed_mm_s) {
    const bool first = self->commanded_us < 0 || at_us < self->commanded_us;
    self->commanded_us = at_us;
    if (!first && speed_mm_s == self->commanded_mm_s) {
        return;
    }
    if (self->measured_us >= 0 && at_us > self->measured_us && at_us - self->measured_us <= GAP_US) {
        pass(self, self->measured_us, at_us, self->measured_mm_s); // The time after it belongs to the new setpoint.
        self->measured_us = at_us;
    }
    if (!self->changing && self->settled_us >= SETTLE_US) {
        self->changing = true;
        self->before_mm_s = self->commanded_mm_s;
        self->before = self->settled_mm / ((double)self->settled_us / 1e6);
        self->way_commanded_mm = self->way_mm = 0;
    }
    self->settled_us = 0;
    self->settled_mm = 0;
    self->commanded_mm_s = speed_mm_s;
    self->constant_us = at_us;
}

/// Returns the rounded mean in ms.
static int32_t mean_ms(const learn_lag_t *self) {
    return (int32_t)lround(self->sum_ms / self->count);
}

static bool is_sure(const learn_lag_t *self) {
    return self->count >= COUNT_MIN && self->most_ms - self->least_ms <= SPREAD_MS && mean_ms(self) >= LAG_MIN_MS &&
           mean_ms(self) <= LAG_MAX_MS;
}

static void weigh_one(const learn_lag_t *self, unsigned side, uint32_t lag_ms, learn_findings_t *out) {
    if (self->count < COUNT_MIN) {
        (void)learn_print(
            out, '?', "wheel_lag", side,
            "%s wheel's lag: the recording lacks two changes by 300 mm/s or more, each with a steady second before and "
            "after it",
            text_side(side));
        return;
    }
    const double off_ms = fabs(self->sum_ms / self->count - (double)lag_ms);
    const bool fits = is_sure(self) && off_ms * 100.0 <= (double)lag_ms * RANGE_PERCENT;
    (void)learn_print(out, fits ? '+' : '-', "wheel_lag", side,
                      "%s wheel is %" PRId32 " ms behind its setpoints (%" PRIu32
                      " changes of speed: %.0f to %.0f); the gateway assumes %" PRIu32 " (wheel_lag_ms)",
                      text_side(side), mean_ms(self), self->count, self->least_ms, self->most_ms, lag_ms);
}

void learn_lag_weigh(const learn_lag_t wheel[IW_SIDES], uint32_t lag_ms, learn_findings_t *out_findings) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        weigh_one(&wheel[side], side, lag_ms, out_findings);
    }
    if (is_sure(&wheel[IW_LEFT]) && is_sure(&wheel[IW_RIGHT])) {
        const int32_t both_ms = (mean_ms(&wheel[IW_LEFT]) + mean_ms(&wheel[IW_RIGHT])) / 2;
        learn_finding_t *finding = learn_print(out_findings, '+', "wheel_lag_ms", LEARN_BOTH,
                                               "both wheels are %" PRId32 " ms behind their setpoints", both_ms);
        (void)snprintf(finding->value, sizeof finding->value, "%" PRId32, both_ms);
    }
}
