// SPDX-License-Identifier: MIT
#include "sim_ranges.h"

static uint32_t between(sim_random_t *random, uint32_t low, uint32_t high) {
    return low + sim_random_below(random, high - low + 1U);
}

static int32_t either_way(sim_random_t *random, int32_t most) {
    return (int32_t)sim_random_below(random, 2U * (uint32_t)most + 1U) - most;
}

/// Chooses an end of a range as often as a value inside: the worst cases are at the ends.
static uint32_t anywhere(sim_random_t *random, uint32_t low, uint32_t high) {
    uint32_t const kind = sim_random_below(random, 4U);
    if (kind < 2U) {
        return (kind == 0U) ? low : high;
    }
    return between(random, low, high);
}

void sim_ranges_machine(sim_pair_config_t *config, sim_random_t *random) {
    int16_t const yaw = (int16_t)either_way(random, SIM_RANGE_YAW_MAX_PERMILLE);
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        sim_motion_config_t *const motion = &config->wheel[side].motion;
        motion->response_us = anywhere(random, SIM_RANGE_LAG_MIN_US, SIM_RANGE_LAG_MAX_US);
        motion->radius_mm = (uint16_t)anywhere(random, SIM_RANGE_RADIUS_MIN_MM, SIM_RANGE_RADIUS_MAX_MM);
        motion->accel_mm_s2 = anywhere(random, SIM_RANGE_ACCEL_MIN_MM_S2, SIM_RANGE_ACCEL_MAX_MM_S2);
        motion->coast_mm_s2 = anywhere(random, SIM_RANGE_COAST_MIN_MM_S2, SIM_RANGE_COAST_MAX_MM_S2);
        motion->yaw_permille = yaw;
    }
}

/// Slope of both wheels in the machine's own direction.
static void set_slope(sim_pair_t *pair, iw_time_us_t now_us, int32_t slope_mm_s2) {
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        sim_motion_t *const motion = &pair->wheel[side].motion;
        sim_motion_advance(motion, now_us);
        motion->slope_mm_s2 = pair->pose.mirrored[side] ? -slope_mm_s2 : slope_mm_s2;
    }
}

void sim_ranges_road(sim_pair_t *pair, iw_time_us_t now_us, sim_random_t *random) {
    uint32_t const loss = anywhere(random, 0U, SIM_RANGE_LOSS_MAX_PERMILLE);
    bool const truncates = sim_random_below(random, 2U) == 0U;
    set_slope(pair, now_us, either_way(random, SIM_RANGE_SLOPE_MAX_MM_S2));
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        sim_wheel_t *const wheel = &pair->wheel[side];
        wheel->motion.droop_permille = (uint16_t)anywhere(random, 0U, SIM_RANGE_DROOP_MAX_PERMILLE);
        wheel->loss_permille = (uint16_t)loss;
        wheel->truncates = truncates;
    }
}

iw_time_us_t sim_ranges_kerb(sim_pair_t *pair, iw_time_us_t now_us, sim_random_t *random) {
    sim_motion_t *const motion = &pair->wheel[sim_random_below(random, IW_SIDES)].motion;
    sim_motion_advance(motion, now_us);
    motion->kerb_permille = (uint16_t)anywhere(random, 0U, SIM_RANGE_KERB_MAX_PERMILLE);
    return now_us + anywhere(random, SIM_RANGE_KERB_MAX_US / 10U, SIM_RANGE_KERB_MAX_US);
}

void sim_ranges_kerb_ends(sim_pair_t *pair, iw_time_us_t now_us) {
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        sim_motion_advance(&pair->wheel[side].motion, now_us);
        pair->wheel[side].motion.kerb_permille = 0U;
    }
}
