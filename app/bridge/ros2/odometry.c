// SPDX-License-Identifier: MIT
#include "odometry.h"

#include <math.h>

#define CONFIRMED 0.01
#define ASSUMED   0.04
#define SLIP      0.02
/// Standard deviation, in ticks, of one wheel's distance in whole ticks (spread evenly), and of the difference of two.
#define TICK_SPREAD  0.29
#define TICKS_SPREAD 0.41
/// Drift of the heading on a straight path of 1 m. It grows with the square root of the path: a sum of many small
/// slips.
#define DRIFT_RAD 0.005
/// Standard deviation of a speed in whole rpm: with a radius of 192 mm one rpm is 20 mm/s, spread evenly.
#define SPEED_STEP_M_S 0.0058
/// Tolerance for messages that are read late and for wheels that a hand spins.
#define JUMP_MM 200

static bool has_jumped(const ros_ways_t *last, const ros_ways_t *now) {
    const int64_t elapsed_us = (now->t_us > last->t_us) ? now->t_us - last->t_us : 0;
    const int64_t most_mm = JUMP_MM + elapsed_us / 1000 * ROS_ODOMETRY_MAX_MM_S / 1000;
    const int64_t left_mm = now->left_mm - last->left_mm;
    const int64_t right_mm = now->right_mm - last->right_mm;
    return left_mm > most_mm || left_mm < -most_mm || right_mm > most_mm || right_mm < -most_mm;
}

/// Adds to the sum of turning. Ticks of the two wheels come one after the other, so on a straight path the heading
/// swings by up to one tick to either side. That is not turning.
static void count_turning(ros_odometry_t *self, double yaw_rad, double tick_rad) {
    const double away_rad = yaw_rad - self->settled_rad;
    const double beyond_rad = fabs(away_rad) - tick_rad;
    if (beyond_rad > 0.0) {
        self->turned_rad += beyond_rad;
        self->settled_rad += copysign(beyond_rad, away_rad);
    }
}

void ros_odometry_step(ros_odometry_t *self, const ros_ways_t *ways, const ros_measures_t *measures) {
    if (!self->begun || has_jumped(&self->last, ways)) {
        const unsigned restarts = self->begun ? self->restarts + 1U : 0U;
        *self = (ros_odometry_t){.begun = true, .start = *ways, .last = *ways, .restarts = restarts};
        return;
    }
    const double left_mm = (double)(ways->left_mm - self->last.left_mm);
    const double right_mm = (double)(ways->right_mm - self->last.right_mm);
    const double turned_mm = (double)((ways->right_mm - self->start.right_mm) - (ways->left_mm - self->start.left_mm));
    const double way_m = (left_mm + right_mm) / 2000.0;
    const double yaw_rad = turned_mm / 1000.0 / measures->track_m;
    const double middle_rad = (self->yaw_rad + yaw_rad) / 2.0;
    self->x_m += way_m * cos(middle_rad);
    self->y_m += way_m * sin(middle_rad);
    self->path_m += fabs(way_m);
    count_turning(self, yaw_rad, measures->tick_m / measures->track_m);
    self->yaw_rad = yaw_rad;
    self->last = *ways;
}

ros_doubt_t ros_odometry_doubt(const ros_odometry_t *self, const ros_measures_t *measures, double v_m_s,
                               double yaw_rad_s) {
    // The parts are independent of each other, so their squares add up.
    const double of_way = hypot(measures->radius_confirmed ? CONFIRMED : ASSUMED, SLIP);
    const double of_turn = hypot(of_way, measures->track_confirmed ? CONFIRMED : ASSUMED);
    const double step_rad = TICKS_SPREAD * measures->tick_m / measures->track_m;
    const double drift_rad = DRIFT_RAD * sqrt(self->path_m);
    const double turn_rad = of_turn * self->turned_rad;
    // A wrong heading leads sideways by that share of the path. The drift was smaller earlier on the path, hence the
    // root of 3. Errors by whole ticks average out.
    const double aside_m = self->path_m * fmin(hypot(turn_rad, drift_rad / sqrt(3.0)), 1.0);
    const double along_m = of_way * self->path_m;
    const double place_m = hypot(TICK_SPREAD * measures->tick_m, hypot(along_m, aside_m));
    return (ros_doubt_t){
        .x_m = place_m,
        .y_m = place_m,
        .yaw_rad = fmin(hypot(hypot(step_rad, drift_rad), turn_rad), M_PI),
        .v_m_s = SPEED_STEP_M_S + of_way * fabs(v_m_s),
        .side_m_s = SPEED_STEP_M_S + SLIP * fabs(v_m_s),
        .yaw_rad_s = SPEED_STEP_M_S * 2.0 / measures->track_m + of_turn * fabs(yaw_rad_s),
    };
}
