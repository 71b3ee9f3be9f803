// SPDX-License-Identifier: MIT
#include "iwheel/private/follow.h"

#include "arithmetic.h"

/// Returns the bit of a verdict in `running`.
#define BIT(verdict) (1U << (uint32_t)(verdict))

void iw_follow_init(iw_follow_t *self, const iw_config_t *config) {
    self->config = config;
    iw_follow_restart(self);
}

/// Starts the timers of conditions that begin to hold, stops those of conditions that end, and returns the most severe
/// verdict that is due.
static iw_follow_verdict_t run_clocks(iw_follow_t *self, iw_time_us_t now_us, uint32_t holds) {
    const uint32_t for_us[IW_FOLLOW_VERDICTS] = {
        [IW_FOLLOW_SIGN] = IW_FOLLOW_SIGN_US,
        [IW_FOLLOW_OVERSPEED] = (uint32_t)self->config->follow_ms * IW_US_PER_MS,
        [IW_FOLLOW_BLOCKED] = (uint32_t)self->config->blocked_ms * IW_US_PER_MS,
    };
    const uint32_t begun = holds & ~(uint32_t)self->running;
    iw_follow_verdict_t verdict = IW_FOLLOW_OK;
    self->running = (uint8_t)holds;
    // All timers run, also after a more severe verdict, because each condition is timed on its own.
    for (uint32_t i = 0; i < IW_FOLLOW_VERDICTS; i++) {
        if ((begun & BIT(i)) != 0U) {
            self->since_us[i] = now_us;
        }
        const bool lasted = (holds & BIT(i)) != 0U && iw_age_us(self->since_us[i], now_us) >= for_us[i];
        if (lasted && verdict == IW_FOLLOW_OK) {
            verdict = (iw_follow_verdict_t)i;
        }
    }
    return verdict;
}

iw_follow_verdict_t iw_follow_step(iw_follow_t *self, iw_time_us_t now_us, int32_t applied_mm_s,
                                   int32_t measured_mm_s) {
    const iw_config_t *const config = self->config;
    const int32_t applied = iw_abs(applied_mm_s);
    const int32_t measured = iw_abs(measured_mm_s);
    // Below IW_SIGN_MM_S a sign may be noise, or a wheel that rolls back on a kerb.
    const bool clear = applied > IW_SIGN_MM_S && measured > IW_SIGN_MM_S;
    const bool same = (applied_mm_s < 0) == (measured_mm_s < 0);
    // Turning backwards is no progress.
    const int32_t progress = same ? measured : 0;
    uint32_t holds = 0;
    if (clear) {
        holds = same ? BIT(IW_FOLLOW_OK) : BIT(IW_FOLLOW_SIGN);
    }
    if (measured > applied + (int32_t)config->follow_mm_s) {
        holds |= BIT(IW_FOLLOW_OVERSPEED);
    }
    if (applied >= IW_FOLLOW_BLOCKED_MIN_MM_S && progress * 100 < applied * IW_FOLLOW_BLOCKED_PERCENT) {
        holds |= BIT(IW_FOLLOW_BLOCKED);
    }
    return ((holds | self->running) == 0U) ? IW_FOLLOW_OK : run_clocks(self, now_us, holds);
}

bool iw_follow_sign_confirmed(const iw_follow_t *self, iw_time_us_t now_us) {
    return (self->running & BIT(IW_FOLLOW_OK)) != 0U &&
           iw_age_us(self->since_us[IW_FOLLOW_OK], now_us) >= IW_FOLLOW_SIGN_US;
}
