// SPDX-License-Identifier: MIT
/// @file
/// Compares the path of the pair with the commanded path. The rules of follow.h judge each wheel alone, but a machine
/// on two wheels turns when only one of them deviates.
///
///     applied --lag--> expected;   measured - expected, less ordinary differences, of each wheel
///     right - left --integral, leaking--> deviation from the commanded path;   beyond pair_mm: it diverges
///
/// The expected speed follows the applied speed as a first-order system with the time constant `wheel_lag_ms`. Ordinary
/// differences do not count: the droop of a loaded wheel, and one step of its telemetry. A steady difference of
/// `pair_mm` in `pair_leak_ms` beyond them is never detected.
///
/// Millimetres and mm/s are those of setpoints, at IW_SETPOINT_RADIUS_MM.
///
/// Pure state machine: no I/O, no clock, no heap, and no function fails. The caller owns `iw_diverge_t` and uses one
/// instance in one context only.
///
/// The best reaction depends on the fault. A blocked wheel turns the machine as long as the other wheel runs: the core
/// commands zero immediately. A wheel that runs on turns the machine as long as it is faster: the core ramps both down.
#ifndef IW_DIVERGE_H
#define IW_DIVERGE_H

#include "iwheel/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A difference from the expected speed of up to this share does not count. Chosen by us.
#define IW_DIVERGE_DROOP_PERCENT 4
/// A wheel below this share of its expected speed is slow: zero immediately. Chosen by us: docs/user/pair.md has the
/// table.
#define IW_DIVERGE_SLOW_PERCENT 80
/// A wheel below this share of its expected speed is practically blocked, and its difference counts double: a kerb does
/// not slow a wheel so much. Chosen by us.
#define IW_DIVERGE_GONE_PERCENT 25
/// That rule applies only above this expected speed, because one rpm is 20 mm/s.
#define IW_DIVERGE_GONE_UM_S 50000
/// Shortest time step of the comparison, so that rounding errors do not add up.
#define IW_DIVERGE_STEP_US 1000U

/// Result of the comparison.
typedef enum {
    IW_DIVERGE_NOT = 0, ///< The pair follows the commanded path.
    IW_DIVERGE_AWAY,    ///< The pair leaves the path: one wheel is too fast, or somewhat slow.
    IW_DIVERGE_SLOW,    ///< The pair leaves the path: one wheel is below IW_DIVERGE_SLOW_PERCENT or turns backwards.
} iw_diverge_verdict_t;

/// State of the comparison.
typedef struct {
    const iw_config_t *config;       ///< Configuration of the owner.
    uint8_t side;                    ///< An iw_side_t: the wheel with the larger difference in the last comparison.
    int32_t applied_mm_s[IW_SIDES];  ///< Applied speeds for the next step. The owner writes them.
    int32_t measured_mm_s[IW_SIDES]; ///< Measured speeds for the next step, from `iw_diverge_receive`.
    int32_t um_s_per_rpm;            ///< Speed in um/s at 1 rpm of telemetry, which is its resolution.
    int32_t expected_um_s[IW_SIDES]; ///< Expected speed of each wheel.
    int32_t path_um;                 ///< Leaking integral of the deviation from the path, right minus left.
    int32_t largest_um;              ///< Largest |path_um| since the drive began.
    iw_time_us_t at_us;              ///< Time of the last comparison.
    iw_time_us_t begun_us;           ///< Time at which the drive began.
} iw_diverge_t;

/// Initializes `self`. `config` must be checked, and must exist as long as `self`.
void iw_diverge_init(iw_diverge_t *self, const iw_config_t *config);

/// Reports the start time of the present drive. If it is a new drive, sets the deviation and the largest one to zero.
void iw_diverge_begin(iw_diverge_t *self, iw_time_us_t begun_us);

/// Sets the deviation to zero while nothing is compared: the core does not drive, a wheel is lost, or a stop without
/// ramp is active. The expected speeds continue from the measured ones, `largest_um` stays.
void iw_diverge_restart(iw_diverge_t *self, iw_time_us_t now_us);

/// Sets the measured speed of a wheel in the machine's frame, limited to +/- 40 000 mm/s. `side`: an iw_side_t, not
/// checked.
void iw_diverge_receive(iw_diverge_t *self, size_t side, int32_t measured_mm_s);

/// Compares the applied and measured speeds since the last comparison, and returns the result. Call it in every step
/// of the core, at `now_us` that does not decrease. Less than IW_DIVERGE_STEP_US after the last comparison it only
/// returns the present result; more than 50 ms count as 50 ms. It sets `side`, `path_um` (+/- 1 m at most) and
/// `largest_um`.
iw_diverge_verdict_t iw_diverge_step(iw_diverge_t *self, iw_time_us_t now_us);

#ifdef __cplusplus
}
#endif
#endif
