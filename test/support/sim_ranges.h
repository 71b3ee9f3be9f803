// SPDX-License-Identifier: MIT
/// The ranges of an ordinary machine on two wheels: nothing inside these ranges may stop it.
///
/// The ranges were fixed before the thresholds were chosen against them, except the time between kerbs (docs/user/pair.md). They are
/// assumptions: they have not been measured on a real pair of wheels.
///
/// motion.h explains each of them. Faults, such as a blocked wheel, are not included.
#ifndef SIM_RANGES_H
#define SIM_RANGES_H

#include "iwheel_sim/pair.h"

/// Lag of the speed controller, for each wheel separately: 60 ms ± 30 %.
#define SIM_RANGE_LAG_MIN_US 42000U
#define SIM_RANGE_LAG_MAX_US 78000U
/// Each wheel separately stays at most this far below its setpoint.
#define SIM_RANGE_DROOP_MAX_PERMILLE 40U
/// A kerb under one wheel: this share of its speed, for this time, recovery included.
#define SIM_RANGE_KERB_MAX_PERMILLE 500U
#define SIM_RANGE_KERB_MAX_US       100000U
/// The next kerb comes at least this much later: deviations add up, and decay within about this time.
#define SIM_RANGE_KERB_APART_US 1000000U
/// Tyre radius, for each wheel separately: 192 mm ± 3 %. It changes the distance, not the telemetry.
#define SIM_RANGE_RADIUS_MIN_MM 187U
#define SIM_RANGE_RADIUS_MAX_MM 197U
/// Load: the acceleration that the motor still has of 4000 mm/s2, and friction, for each wheel separately.
#define SIM_RANGE_ACCEL_MIN_MM_S2 3000U
#define SIM_RANGE_ACCEL_MAX_MM_S2 4000U
#define SIM_RANGE_COAST_MIN_MM_S2 500U
#define SIM_RANGE_COAST_MAX_MM_S2 900U
/// A slope of up to 8 % in either direction, along the path of both wheels.
#define SIM_RANGE_SLOPE_MAX_MM_S2 785
/// Yaw inertia: turning is up to 10 % slower or faster than going straight, on top of the lags.
#define SIM_RANGE_YAW_MAX_PERMILLE 50
/// Lost telemetry and setpoints.
#define SIM_RANGE_LOSS_MAX_PERMILLE 100U

/// Sets a machine anywhere within the ranges: lag, radius, load, friction and yaw inertia.
void sim_ranges_machine(sim_pair_config_t *config, sim_random_t *random);

/// Sets the surroundings: slope, droop, loss, and whether the rpm are truncated. Can be called at any time.
void sim_ranges_road(sim_pair_t *pair, iw_time_us_t now_us, sim_random_t *random);

/// Begins a kerb under one wheel; returns the time when it ends.
iw_time_us_t sim_ranges_kerb(sim_pair_t *pair, iw_time_us_t now_us, sim_random_t *random);

/// Ends the kerbs of both wheels.
void sim_ranges_kerb_ends(sim_pair_t *pair, iw_time_us_t now_us);

#endif
