// SPDX-License-Identifier: MIT
/// Time by which each wheel follows its setpoints late: `wheel_lag_ms` of the rule of the pair. If a wheel follows a
/// change of speed with a lag, its distance is shorter than commanded by the change times the lag, for any form of the
/// change.
///
///     lag = area under (commanded - before) / commanded change  -  area under (measured - before) / measured change
///
/// Both areas run from a steady speed to the next one. Droop and a wrong scale cancel out.
#ifndef LEARN_LAG_H
#define LEARN_LAG_H

#include "learn_findings.h"

/// State of one wheel.
typedef struct {
    int32_t commanded_mm_s;
    int64_t commanded_us; ///< Time of the last setpoint; -1: none.
    int64_t constant_us;  ///< Time since which this is the setpoint.
    double measured_mm_s;
    int64_t measured_us; ///< Time of the last speed frame; -1: none.
    double settled_mm;   ///< Distance and time at this setpoint, after the wheel has reached it.
    int64_t settled_us;
    bool changing;           ///< The speed changes from a steady speed.
    double before_mm_s;      ///< Steady speed before the change, commanded,
    double before;           ///< and measured.
    int64_t change_us;       ///< Duration of the change so far.
    double way_commanded_mm; ///< Commanded distance beyond that of the steady speed.
    double way_mm;           ///< Measured distance beyond that of the steady speed.
    uint32_t count;          ///< Number of measured changes.
    double sum_ms;
    double least_ms;
    double most_ms;
} learn_lag_t;

void learn_lag_init(learn_lag_t *self);
void learn_lag_command(learn_lag_t *self, int64_t at_us, int32_t speed_mm_s);
void learn_lag_receive(learn_lag_t *self, int64_t at_us, double speed_mm_s);

/// Adds the findings about both wheels; `lag_ms` is the value that the gateway assumes.
void learn_lag_weigh(const learn_lag_t wheel[IW_SIDES], uint32_t lag_ms, learn_findings_t *out_findings);

#endif
