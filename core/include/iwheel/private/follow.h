// SPDX-License-Identifier: MIT
/// @file
/// Compares the commanded and the measured speed of one wheel, because a wheel does not acknowledge a setpoint.
///
/// It detects a wheel that turns in the other direction, faster than commanded, or not at all. Each condition must hold
/// without interruption for some time before it counts.
#ifndef IW_FOLLOW_H
#define IW_FOLLOW_H

#include "iwheel/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Duration of opposite signs that counts. Safety rule.
#define IW_FOLLOW_SIGN_US 300000U
/// A wheel is blocked below this share of its command ...
#define IW_FOLLOW_BLOCKED_PERCENT 20
/// ... if the command is at least this. Below it the resolution of 1 rpm (20 mm/s) is too coarse. Chosen by us.
#define IW_FOLLOW_BLOCKED_MIN_MM_S 100

/// Result of the comparison.
typedef enum {
    IW_FOLLOW_OK = 0,    ///< No fault. Its timer runs while both signs are equal and both speeds above IW_SIGN_MM_S.
    IW_FOLLOW_SIGN,      ///< The wheel turns opposite to its command.
    IW_FOLLOW_OVERSPEED, ///< The wheel is faster than its applied speed by follow_mm_s for follow_ms.
    IW_FOLLOW_BLOCKED,   ///< The wheel is below 20 % of its command for blocked_ms.
    IW_FOLLOW_VERDICTS,
} iw_follow_verdict_t;

/// Timers of one wheel.
typedef struct {
    const iw_config_t *config;                 ///< Configuration of the owner.
    uint8_t running;                           ///< Bit mask of results whose condition holds, so that their timer runs.
    iw_time_us_t since_us[IW_FOLLOW_VERDICTS]; ///< Start time of each running timer.
} iw_follow_t;

/// Initializes `self`. `config` must be checked, and must exist as long as `self`.
void iw_follow_init(iw_follow_t *self, const iw_config_t *config);

/// Stops all timers, while the core does not drive.
static inline void iw_follow_restart(iw_follow_t *self) {
    self->running = 0;
}

/// Compares the applied and the measured speed, both in the machine's frame and in the unit of setpoints. Returns the
/// most severe fault.
iw_follow_verdict_t iw_follow_step(iw_follow_t *self, iw_time_us_t now_us, int32_t applied_mm_s, int32_t measured_mm_s);

/// Returns true if command and measurement have had equal signs, both above IW_SIGN_MM_S, for IW_FOLLOW_SIGN_US.
bool iw_follow_sign_confirmed(const iw_follow_t *self, iw_time_us_t now_us);

#ifdef __cplusplus
}
#endif
#endif
