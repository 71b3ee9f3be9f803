// SPDX-License-Identifier: MIT
#include "iwheel/private/follow.h"

#include "magnitude.h"

#include <string.h>

// iw_follow_restart sets every byte.
IW_STATIC_ASSERT(IW_NEVER == UINT64_MAX, never_is_all_ones_to_follow);

void iw_follow_init(iw_follow_t *self, const iw_config_t *config) {
    self->config = config;
    iw_follow_restart(self);
}

void iw_follow_restart(iw_follow_t *self) {
    memset(self->since_us, 0xFF, sizeof self->since_us); // IW_NEVER
}

/// Keeps the start of a condition; true once it has held without a break for `for_us`.
static bool lasts(iw_time_us_t *since_us, iw_time_us_t now_us, bool holds, uint32_t for_us) {
    if (!holds) {
        *since_us = IW_NEVER;
        return false;
    }
    if (*since_us == IW_NEVER) {
        *since_us = now_us;
    }
    return now_us - *since_us >= for_us;
}

iw_follow_verdict_t iw_follow_step(iw_follow_t *self, iw_time_us_t now_us, int32_t applied_mm_s,
                                   int32_t measured_mm_s) {
    const iw_config_t *const config = self->config;
    const int32_t applied = iw_magnitude(applied_mm_s);
    const int32_t measured = iw_magnitude(measured_mm_s);
    // Below IW_SIGN_MM_S a sign may be noise, or a wheel that rolls back on a kerb.
    const bool clear = applied > IW_SIGN_MM_S && measured > IW_SIGN_MM_S;
    const bool same = (applied_mm_s < 0) == (measured_mm_s < 0);
    // Turning backwards is no progress.
    const int32_t progress = same ? measured : 0;
    const bool holds[IW_FOLLOW_VERDICTS] = {
        clear && same,
        clear && !same,
        measured > applied + (int32_t)config->follow_mm_s,
        applied >= IW_FOLLOW_BLOCKED_MIN_MM_S && progress * 100 < applied * IW_FOLLOW_BLOCKED_PERCENT,
    };
    const uint32_t for_us[IW_FOLLOW_VERDICTS] = {
        IW_FOLLOW_SIGN_US,
        IW_FOLLOW_SIGN_US,
        (uint32_t)config->follow_ms * IW_US_PER_MS,
        (uint32_t)config->blocked_ms * IW_US_PER_MS,
    };
    // All clocks run on, also behind a graver verdict: each condition must be timed by itself.
    iw_follow_verdict_t verdict = IW_FOLLOW_OK;
    for (uint32_t i = 0; i < IW_FOLLOW_VERDICTS; i++) {
        const bool lasted = lasts(&self->since_us[i], now_us, holds[i], for_us[i]);
        verdict = (lasted && verdict == IW_FOLLOW_OK) ? (iw_follow_verdict_t)i : verdict;
    }
    return verdict;
}

bool iw_follow_sign_confirmed(const iw_follow_t *self, iw_time_us_t now_us) {
    return self->since_us[IW_FOLLOW_OK] != IW_NEVER && now_us - self->since_us[IW_FOLLOW_OK] >= IW_FOLLOW_SIGN_US;
}
