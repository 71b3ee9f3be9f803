// SPDX-License-Identifier: MIT
/// What counts as ordinary of a machine on two wheels: nothing inside these ranges may stop it.
///
/// They were fixed before the thresholds were chosen against them, but for the time between kerbs (docs/user/pair.md). They are
/// assumptions: nobody has measured them on a real pair of wheels.
///
/// What each of them means is in motion.h. Not in here: faults, such as a blocked wheel.
#ifndef SIM_RANGES_H
#define SIM_RANGES_H

#include "iwheel_sim/pair.h"

/// Lag of the speed controller, each wheel on its own: 60 ms and 30 % either way.
#define SIM_RANGE_LAG_MIN_US 42000U
#define SIM_RANGE_LAG_MAX_US 78000U
/// Each wheel on its own stays so far below its setpoint at the most.
#define SIM_RANGE_DROOP_MAX_PERMILLE 40U
/// A kerb under one wheel: so much of its speed, for so long, recovery included.
#define SIM_RANGE_KERB_MAX_PERMILLE 500U
#define SIM_RANGE_KERB_MAX_US       100000U
/// The next one comes this much later at the earliest: deviations add up, and leak away within about this time.
#define SIM_RANGE_KERB_APART_US 1000000U
/// Tyre radius, each wheel on its own: 192 mm and 3 % either way. It changes the way, not what telemetry tells.
#define SIM_RANGE_RADIUS_MIN_MM 187U
#define SIM_RANGE_RADIUS_MAX_MM 197U
/// Load: what acceleration the motor has left of 4000 mm/s2, and friction, each wheel on its own.
#define SIM_RANGE_ACCEL_MIN_MM_S2 3000U
#define SIM_RANGE_ACCEL_MAX_MM_S2 4000U
#define SIM_RANGE_COAST_MIN_MM_S2 500U
#define SIM_RANGE_COAST_MAX_MM_S2 900U
/// A slope of 8 % either way, along the way of both wheels.
#define SIM_RANGE_SLOPE_MAX_MM_S2 785
/// Yaw inertia: turning is up to 10 % slower or faster than going straight, on top of the lags.
#define SIM_RANGE_YAW_MAX_PERMILLE 50
/// Telemetry and setpoints that are lost.
#define SIM_RANGE_LOSS_MAX_PERMILLE 100U

/// A machine from anywhere within the ranges: lag, radius, load, friction and yaw inertia.
void sim_ranges_machine(sim_pair_config_t *config, sim_random_t *random);

/// The way it stands: slope, droop, loss, and whether the rpm are cut off. At any time.
void sim_ranges_road(sim_pair_t *pair, iw_time_us_t now_us, sim_random_t *random);

/// A kerb under one wheel begins; returns when it ends.
iw_time_us_t sim_ranges_kerb(sim_pair_t *pair, iw_time_us_t now_us, sim_random_t *random);

/// No wheel is on a kerb any more.
void sim_ranges_kerb_ends(sim_pair_t *pair, iw_time_us_t now_us);

#endif
