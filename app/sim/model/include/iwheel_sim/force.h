// SPDX-License-Identifier: MIT
/// Normal-force sensor of one wheel: its zero, the load on the shaft, noise, and the offset that the wheel learns at
/// its start.
///
/// A load is a person: it sways by 5 % at 0.7 Hz. The offset is the mean of the sensor values of the first two seconds
/// after the start of the firmware. A load at that time becomes part of the offset, as in reality.
#ifndef IWHEEL_SIM_FORCE_H
#define IWHEEL_SIM_FORCE_H

#include "iwheel/config.h"
#include "iwheel_sim/random.h"

/// Time after the start of the firmware during which the wheel averages the sensor values.
#define SIM_FORCE_LEARN_US 2000000U
/// Value of `forced_raw`: no raw value is forced.
#define SIM_FORCE_AUTO INT32_MIN

typedef struct {
    int64_t learn_sum_mN;
    uint32_t learn_count;
    int32_t sensor_zero_mN; ///< Sensor value without load; the wheel does not know it.
    int32_t load_mN;
    int32_t noise_mN;     ///< Amplitude.
    int32_t forced_raw;   ///< Fault: the force frame carries this value; SIM_FORCE_AUTO: no fault.
    int16_t learned_dN;   ///< Offset in the wheel's offset frame; not valid during the first two seconds.
    iw_force_unit_t unit; ///< Unit of the raw value in the frame. The offset is always in dN.
    bool zero_removed;    ///< Fault: the sensor's zero is already subtracted from the raw value.
} sim_force_t;

void sim_force_init(sim_force_t *self, int32_t sensor_zero_mN, iw_force_unit_t unit);

/// Starts the learning of the offset again. The caller starts the firmware.
void sim_force_restart(sim_force_t *self);

/// Returns the raw value of a force frame that is due at `now_us`, saturated to int16. `learning` is true during the
/// first two seconds after the start of the firmware.
int16_t sim_force_sample(sim_force_t *self, iw_time_us_t now_us, bool learning, sim_random_t *random);

#endif
