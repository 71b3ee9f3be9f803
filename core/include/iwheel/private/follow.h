// SPDX-License-Identifier: MIT
/// @file
/// Does a wheel do what it is told? Nothing acknowledges a setpoint, so commanded and measured speed are compared.
///
/// Three ways not to: turning the other way, turning faster than told, not turning. Each must last before it counts;
/// the time runs only while the condition holds without a break.
#ifndef IW_FOLLOW_H
#define IW_FOLLOW_H

#include "iwheel/config.h"

/// Opposite signs must last this long. Safety rule.
#define IW_FOLLOW_SIGN_US 300000U
/// A wheel is blocked below this share of its command ...
#define IW_FOLLOW_BLOCKED_PERCENT 20
/// ... if the command is at least this; below it 1 rpm of resolution (20 mm/s) is too coarse to tell. Ours.
#define IW_FOLLOW_BLOCKED_MIN_MM_S 100

/// What the comparison shows.
typedef enum {
    IW_FOLLOW_OK = 0,    ///< Its clock: same sign, both above IW_SIGN_MM_S.
    IW_FOLLOW_SIGN,      ///< Opposite to its command.
    IW_FOLLOW_OVERSPEED, ///< Faster than applied by follow_mm_s for follow_ms.
    IW_FOLLOW_BLOCKED,   ///< Below 20 % of its command for blocked_ms.
    IW_FOLLOW_VERDICTS,
} iw_follow_verdict_t;

/// The clocks of one wheel.
typedef struct {
    const iw_config_t *config;                 ///< The owner's.
    uint8_t running;                           ///< Bit per verdict: its condition holds, and its clock runs.
    iw_time_us_t since_us[IW_FOLLOW_VERDICTS]; ///< When each clock that runs was started.
} iw_follow_t;

/// `config` must be checked and outlive it.
void iw_follow_init(iw_follow_t *self, const iw_config_t *config);

/// Starts all clocks anew: nothing is being compared (the wheels are not ours, or our loop was late).
static inline void iw_follow_restart(iw_follow_t *self) {
    self->running = 0;
}

/// Compares the speed applied and measured now, both in the machine's frame and in the unit of setpoints. The gravest
/// verdict comes first.
iw_follow_verdict_t iw_follow_step(iw_follow_t *self, iw_time_us_t now_us, int32_t applied_mm_s, int32_t measured_mm_s);

/// True if command and measurement have agreed in sign, both above IW_SIGN_MM_S, for IW_FOLLOW_SIGN_US.
bool iw_follow_sign_confirmed(const iw_follow_t *self, iw_time_us_t now_us);

#endif
