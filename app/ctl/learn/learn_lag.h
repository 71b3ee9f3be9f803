// SPDX-License-Identifier: MIT
/// How far each wheel stays behind its setpoints in time: `wheel_lag_ms` of the rule of the pair. A wheel that follows a
/// change of speed with a lag covers less than it was told by the change times the lag, whatever the form of the change.
///
///     lag = area under (told - before) / change told  -  area under (measured - before) / change measured
///
/// Both areas run from a steady speed to the next one. Droop and a wrong scale cancel out.
#ifndef LEARN_LAG_H
#define LEARN_LAG_H

#include "learn_findings.h"

/// One wheel.
typedef struct {
    int32_t commanded_mm_s;
    int64_t told_us;     ///< The last setpoint; -1: none.
    int64_t constant_us; ///< It is that since then.
    double measured_mm_s;
    int64_t measured_us; ///< The last speed frame; -1: none.
    double settled_mm;   ///< Way and time at this speed, once the wheel has reached it.
    int64_t settled_us;
    bool changing;      ///< From a steady speed.
    double before_told; ///< That speed, as told,
    double before;      ///< and as measured.
    int64_t change_us;  ///< So long by now.
    double way_told_mm; ///< Beyond that of the steady speed.
    double way_mm;      ///< The same as measured.
    uint32_t count;     ///< Changes that were measured.
    double sum_ms;
    double least_ms;
    double most_ms;
} learn_lag_t;

void learn_lag_init(learn_lag_t *self);
void learn_lag_tell(learn_lag_t *self, int64_t at_us, int32_t speed_mm_s);
void learn_lag_receive(learn_lag_t *self, int64_t at_us, double speed_mm_s);

/// Adds what both wheels showed; `lag_ms` is what the gateway assumes.
void learn_lag_weigh(const learn_lag_t wheel[IW_SIDES], uint32_t lag_ms, learn_findings_t *out_findings);

#endif
