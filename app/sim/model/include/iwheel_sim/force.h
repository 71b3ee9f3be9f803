// SPDX-License-Identifier: MIT
/// The normal-force sensor of one wheel: its own zero, the load on the shaft, noise, and the offset the wheel learns at
/// its start.
///
/// A load is a person: it sways by 5 % at 0.7 Hz. The offset is the mean of what the sensor shows during the first two
/// seconds after the firmware started, whatever it shows: a load at that time goes into it, as in reality.
#ifndef IWHEEL_SIM_FORCE_H
#define IWHEEL_SIM_FORCE_H

#include "iwheel/config.h"
#include "iwheel_sim/random.h"

/// The wheel averages this long after its start.
#define SIM_FORCE_LEARN_US 2000000U
/// No raw value is forced.
#define SIM_FORCE_AUTO INT32_MIN

typedef struct {
    int64_t learn_sum_mN;
    uint32_t learn_count;
    int32_t sensor_zero_mN; ///< What the sensor shows without load: unknown to the wheel.
    int32_t load_mN;
    int32_t noise_mN;     ///< Amplitude.
    int32_t forced_raw;   ///< Fault: the frame carries this; SIM_FORCE_AUTO: no.
    int16_t learned_dN;   ///< The wheel's offset, as its frame tells; meaningless before two seconds are over.
    iw_force_unit_t unit; ///< Of the frame's raw value. The offset is always in dN.
    bool zero_removed;    ///< Fault: the raw value has the sensor's zero taken out already.
} sim_force_t;

void sim_force_init(sim_force_t *self, int32_t sensor_zero_mN, iw_force_unit_t unit);

/// The firmware starts: learning begins anew.
void sim_force_restart(sim_force_t *self);

/// The raw value of a force frame due at `now_us`, saturated at int16. `learning`: the first two seconds are not over.
int16_t sim_force_sample(sim_force_t *self, iw_time_us_t now_us, bool learning, sim_random_t *random);

#endif
