// SPDX-License-Identifier: MIT
/// @file
/// Do both wheels together go where they are commanded? Each rule of follow.h judges one wheel; a machine on two wheels
/// turns when only one of them does something else.
///
///     applied --lag--> expected;   measured - expected, less what is ordinary, of each wheel
///     right - left --integral, leaking--> deviation from the commanded path;   beyond pair_mm: it diverges
///
/// The expected speed follows the applied one as a first-order system with the time constant `wheel_lag_ms`. Ordinary
/// is what a loaded wheel stays below its setpoint, and a step of its telemetry: so much of the
/// difference does not count. A steady difference of `pair_mm` in `pair_leak_ms` on top of it is never noticed.
///
/// Millimetres and mm/s are those of setpoints, at IW_SETPOINT_RADIUS_MM.
///
/// The best reaction depends on what happened. A wheel that is blocked turns the machine for as long as the other one
/// goes on: zero at once. A wheel that runs on turns it for as long as it is faster: common ramp.
#ifndef IW_DIVERGE_H
#define IW_DIVERGE_H

#include "iwheel/config.h"

/// What a wheel may stay below or above its expected speed without counting. Ours.
#define IW_DIVERGE_DROOP_PERCENT 4
/// A wheel below this share of its expected speed has hardly any: zero at once. Ours: docs/user/pair.md has the table.
#define IW_DIVERGE_SLOW_PERCENT 80
/// A wheel below this share of its expected speed is as good as blocked, and its difference counts double: no kerb does
/// that. Ours.
#define IW_DIVERGE_GONE_PERCENT 25
/// Not where the wheel is expected to be slower than this: one rpm is 20 mm/s.
#define IW_DIVERGE_GONE_UM_S 50000
/// Time is taken in steps of at least this, so that roundings do not add up.
#define IW_DIVERGE_STEP_US 1000U

/// What the comparison shows.
typedef enum {
    IW_DIVERGE_NOT = 0, ///< The pair goes where it is commanded.
    IW_DIVERGE_AWAY,    ///< It does not: one wheel is too fast, or somewhat slow.
    IW_DIVERGE_SLOW,    ///< It does not: one wheel has hardly any of its speed, or turns backwards.
} iw_diverge_verdict_t;

/// The pair, compared.
typedef struct {
    const iw_config_t *config;       ///< The owner's.
    uint8_t side;                    ///< An iw_side_t: whose speed differs more. Of the last step that compared.
    int32_t applied_mm_s[IW_SIDES];  ///< For the next step, written by the owner.
    int32_t measured_mm_s[IW_SIDES]; ///< The same, by `iw_diverge_receive`.
    int32_t um_s_per_rpm;            ///< Speed in um/s at 1 rpm of telemetry, a step of it.
    int32_t expected_um_s[IW_SIDES]; ///< Where each wheel should be by now.
    int32_t path_um;                 ///< Right minus left: how far the pair has left its path, leaking.
    int32_t largest_um;              ///< The largest |path_um| since the drive began.
    iw_time_us_t at_us;              ///< Compared up to here.
    iw_time_us_t begun_us;           ///< When the drive began.
} iw_diverge_t;

/// `config` must be checked and outlive it.
void iw_diverge_init(iw_diverge_t *self, const iw_config_t *config);

/// The drive that began at that time is going on: with a new one the deviation, and the largest of it, begin from zero.
void iw_diverge_begin(iw_diverge_t *self, iw_time_us_t begun_us);

/// The deviation is forgotten: nothing is compared (not ours, a wheel not heard, our loop late, zero at once). What is
/// expected goes on from what is measured.
void iw_diverge_restart(iw_diverge_t *self, iw_time_us_t now_us);

/// How fast a wheel turns, in the machine's frame.
void iw_diverge_receive(iw_diverge_t *self, size_t side, int32_t measured_mm_s);

/// Compares what is applied and measured since the last step.
iw_diverge_verdict_t iw_diverge_step(iw_diverge_t *self, iw_time_us_t now_us);

#endif
