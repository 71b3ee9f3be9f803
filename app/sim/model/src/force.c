// SPDX-License-Identifier: MIT
#include "iwheel_sim/force.h"

#include "iwheel_sim/trig.h"

#define NOISE_mN       250
#define SWAY_PERIOD_US 1428571U
#define SWAY_PERCENT   5
#define MN_PER_CN      10
#define MN_PER_DN      100

static int16_t saturate(int64_t value) {
    if (value > INT16_MAX) {
        return INT16_MAX;
    }
    return (value < INT16_MIN) ? INT16_MIN : (int16_t)value;
}

static int64_t divide(int64_t value, int64_t unit) {
    return (value + ((value < 0) ? -unit / 2 : unit / 2)) / unit;
}

void sim_force_init(sim_force_t *self, int32_t sensor_zero_mN, iw_force_unit_t unit) {
    *self = (sim_force_t){
        .sensor_zero_mN = sensor_zero_mN, .noise_mN = NOISE_mN, .forced_raw = SIM_FORCE_AUTO, .unit = unit};
    self->learned_dN = saturate(divide(sensor_zero_mN, MN_PER_DN));
}

void sim_force_restart(sim_force_t *self) {
    self->learn_sum_mN = 0;
    self->learn_count = 0U;
}

static int32_t swaying_load(const sim_force_t *self, iw_time_us_t now_us) {
    if (self->load_mN == 0) {
        return 0;
    }
    int64_t const phase = (int64_t)(now_us % SWAY_PERIOD_US) * SIM_TRIG_TURN_nrad / (int64_t)SWAY_PERIOD_US;
    int64_t const amplitude = (int64_t)self->load_mN * SWAY_PERCENT / 100;
    return self->load_mN + (int32_t)(amplitude * sim_trig_sin(phase) / SIM_TRIG_ONE);
}

int16_t sim_force_sample(sim_force_t *self, iw_time_us_t now_us, bool learning, sim_random_t *random) {
    int32_t const pressed = swaying_load(self, now_us) + sim_random_noise(random, self->noise_mN);
    int32_t const shown = pressed + self->sensor_zero_mN;
    if (learning) {
        self->learn_sum_mN += shown;
        self->learn_count += 1U;
        self->learned_dN = saturate(divide(self->learn_sum_mN / (int64_t)self->learn_count, MN_PER_DN));
    }
    if (self->forced_raw != SIM_FORCE_AUTO) {
        return saturate(self->forced_raw);
    }
    return saturate(divide(self->zero_removed ? pressed : shown, (self->unit == IW_FORCE_CN) ? MN_PER_CN : MN_PER_DN));
}
