// SPDX-License-Identifier: MIT
#include "iwheel/diverge.h"

#include "arithmetic.h"

#include <string.h>

/// Shares are in 1/2^16.
#define SHARE_ONE 65536U
/// Longest time between two comparisons that counts. It is longer after a late step, which compares nothing.
#define ELAPSED_MAX_US 50000U
/// Speeds and deviations are limited to these values, far above every configurable value.
#define SPEED_MAX_MM_S 40000
#define PATH_MAX_UM    1000000

/// 1 rpm of a wheel with IW_SETPOINT_RADIUS_MM, in um/s: 2 pi x 192 mm / 60 s.
#define UM_S_PER_RPM 20106U

void iw_diverge_init(iw_diverge_t *self, const iw_config_t *config) {
    memset(self, 0, sizeof *self);
    self->config = config;
    self->um_s_per_rpm =
        (int32_t)(config->rpm_of_rotor ? UM_S_PER_RPM * config->gear_per / config->gear_turns : UM_S_PER_RPM);
}

void iw_diverge_begin(iw_diverge_t *self, iw_time_us_t begun_us) {
    if (self->begun_us != begun_us) {
        self->begun_us = begun_us;
        self->path_um = 0;
        self->largest_um = 0;
    }
}

static int32_t clamp(int32_t value, int32_t bound) {
    if (value > bound) {
        return bound;
    }
    return (value < -bound) ? -bound : value;
}

void iw_diverge_receive(iw_diverge_t *self, size_t side, int32_t measured_mm_s) {
    self->measured_mm_s[side] = clamp(measured_mm_s, SPEED_MAX_MM_S);
}

void iw_diverge_restart(iw_diverge_t *self, iw_time_us_t now_us) {
    self->at_us = now_us;
    self->path_um = 0;
    self->expected_um_s[IW_LEFT] = self->measured_mm_s[IW_LEFT] * 1000;
    self->expected_um_s[IW_RIGHT] = self->measured_mm_s[IW_RIGHT] * 1000;
}

/// Returns elapsed / span, at most one.
static IW_APART uint32_t share_of(uint32_t elapsed_us, uint32_t span_us) {
    return (elapsed_us < span_us) ? (elapsed_us * SHARE_ONE + span_us / 2U) / span_us : SHARE_ONE;
}

/// Uses the midpoint of the elapsed time, so that long and short steps have the same result.
static uint32_t lag_share(uint32_t elapsed_us, uint32_t constant_ms) {
    return share_of(elapsed_us, constant_ms * IW_US_PER_MS + elapsed_us / 2U);
}

static IW_APART int32_t part_of(int32_t value, uint32_t share) {
    return (int32_t)((int64_t)value * (int64_t)share / (int64_t)SHARE_ONE);
}

/// Turning backwards is no progress.
static IW_APART bool is_below(const iw_diverge_t *self, size_t side, int32_t percent) {
    const int32_t expected = self->expected_um_s[side];
    const int32_t measured = self->measured_mm_s[side] * 1000;
    const int32_t progress = ((expected < 0) == (measured < 0)) ? iw_abs(measured) : 0;
    return progress / percent < iw_abs(expected) / 100;
}

/// Returns the difference between measured and expected speed beyond ordinary differences; negative if the wheel is
/// slower.
static IW_APART int32_t beyond_um_s(const iw_diverge_t *self, size_t side) {
    const int32_t expected = self->expected_um_s[side];
    const int32_t difference = self->measured_mm_s[side] * 1000 - expected;
    const int32_t ordinary = iw_abs(expected) / 100 * IW_DIVERGE_DROOP_PERCENT + self->um_s_per_rpm * 7 / 8;
    if (iw_abs(expected) >= IW_DIVERGE_GONE_UM_S && is_below(self, side, IW_DIVERGE_GONE_PERCENT)) {
        return 2 * difference;
    }
    return difference - clamp(difference, ordinary);
}

static void integrate(iw_diverge_t *self, uint32_t elapsed_us) {
    const iw_config_t *const config = self->config;
    const uint32_t lag = lag_share(elapsed_us, config->wheel_lag_ms);
    for (size_t side = 0; side < IW_SIDES; side++) {
        const int32_t short_of = self->applied_mm_s[side] * 1000 - self->expected_um_s[side];
        const int32_t next = self->expected_um_s[side] + part_of(short_of, lag);
        self->expected_um_s[side] = clamp(next, SPEED_MAX_MM_S * 1000);
    }
    const int32_t left = beyond_um_s(self, IW_LEFT);
    const int32_t right = beyond_um_s(self, IW_RIGHT);
    const int32_t leaked = part_of(self->path_um, lag_share(elapsed_us, config->pair_leak_ms));
    const int32_t moved = part_of(right - left, share_of(elapsed_us, IW_US_PER_MS * 1000U));
    self->path_um = clamp(self->path_um - leaked + moved, PATH_MAX_UM);
    self->side = (iw_abs(left) > iw_abs(right)) ? IW_LEFT : IW_RIGHT;
}

iw_diverge_verdict_t iw_diverge_step(iw_diverge_t *self, iw_time_us_t now_us) {
    const uint32_t elapsed_us = iw_age_us(self->at_us, now_us);
    if (elapsed_us >= IW_DIVERGE_STEP_US) {
        integrate(self, (elapsed_us < ELAPSED_MAX_US) ? elapsed_us : ELAPSED_MAX_US);
        self->at_us = now_us;
    }
    const int32_t path_um = iw_abs(self->path_um);
    if (path_um > self->largest_um) {
        self->largest_um = path_um;
    }
    if (path_um < (int32_t)self->config->pair_mm * 1000) {
        return IW_DIVERGE_NOT;
    }
    return is_below(self, self->side, IW_DIVERGE_SLOW_PERCENT) ? IW_DIVERGE_SLOW : IW_DIVERGE_AWAY;
}
