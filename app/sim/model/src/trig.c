// SPDX-License-Identifier: MIT
#include "iwheel_sim/trig.h"

#define NRAD_PER_RAD INT64_C(1000000000)

int64_t sim_trig_sin(int64_t angle_nrad) {
    int64_t angle = angle_nrad % SIM_TRIG_TURN_nrad;
    int64_t sign = 1;
    if (angle < 0) {
        angle = -angle;
        sign = -1;
    }
    if (angle > SIM_TRIG_TURN_nrad / 2) {
        angle -= SIM_TRIG_TURN_nrad / 2;
        sign = -sign;
    }
    if (angle > SIM_TRIG_TURN_nrad / 4) {
        angle = (SIM_TRIG_TURN_nrad / 2) - angle;
    }
    // Taylor series to x^9 on 0..pi/2, by Horner's rule.
    int64_t const x = angle * SIM_TRIG_ONE / NRAD_PER_RAD;
    int64_t const square = x * x / SIM_TRIG_ONE;
    int64_t series = SIM_TRIG_ONE - square / 72;
    series = SIM_TRIG_ONE - square * series / SIM_TRIG_ONE / 42;
    series = SIM_TRIG_ONE - square * series / SIM_TRIG_ONE / 20;
    series = SIM_TRIG_ONE - square * series / SIM_TRIG_ONE / 6;
    return sign * (x * series / SIM_TRIG_ONE);
}

int64_t sim_trig_cos(int64_t angle_nrad) {
    return sim_trig_sin((angle_nrad % SIM_TRIG_TURN_nrad) + SIM_TRIG_TURN_nrad / 4);
}
