// SPDX-License-Identifier: MIT
/// Sine and cosine in integers, so that a simulation has the same bytes with every compiler and on every machine.
#ifndef IWHEEL_SIM_TRIG_H
#define IWHEEL_SIM_TRIG_H

#include <stdint.h>

/// Value that represents 1.
#define SIM_TRIG_ONE       ((int64_t)1 << 30)
#define SIM_TRIG_TURN_nrad INT64_C(6283185307)

/// Returns the sine of any angle in nanoradians, in units of 1 / SIM_TRIG_ONE. The error is below 1e-5.
int64_t sim_trig_sin(int64_t angle_nrad);

int64_t sim_trig_cos(int64_t angle_nrad);

#endif
