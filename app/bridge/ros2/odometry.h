// SPDX-License-Identifier: MIT
/// Computes the pose of the machine from the distances of its wheels (REP-103: m, rad, x forward, y to the left). Pure.
///
/// It integrates the distances that the gateway counts in ticks, never speeds, so that the next message makes up for a
/// late or lost one. The heading is computed from the total distances since the start, so that it does not drift by
/// rounding. The pose restarts at 0 0 0 only when a distance jumps: by more than a wheel can have covered since the
/// last message.
#ifndef ROS2_ODOMETRY_H
#define ROS2_ODOMETRY_H

#include <stdbool.h>
#include <stdint.h>

/// Above the greatest speed of these wheels.
#define ROS_ODOMETRY_MAX_MM_S 6000

typedef struct {
    int64_t t_us;
    int64_t left_mm;
    int64_t right_mm;
} ros_ways_t;

/// Measures of the machine, and whether they are confirmed.
typedef struct {
    bool radius_confirmed;
    bool track_confirmed;
    double tick_m;  ///< Distance of one odometry tick, above 0.
    double track_m; ///< Above 0 in every call of this module; 0: not configured, so there is no odometry.
} ros_measures_t;

typedef struct {
    bool begun;
    ros_ways_t start;
    ros_ways_t last;
    double x_m, y_m, yaw_rad;
    double path_m;      ///< Distance covered by the middle between the wheels; forwards and backwards both add.
    double turned_rad;  ///< Sum of turning to both sides, without the part that ticks alone show on a straight path.
    double settled_rad; ///< Heading up to which turning has been counted: within one tick of `yaw_rad`.
    unsigned restarts;  ///< Jumps so far.
} ros_odometry_t;

void ros_odometry_step(ros_odometry_t *self, const ros_ways_t *ways, const ros_measures_t *measures);

/// Standard deviations.
typedef struct {
    double x_m, y_m, yaw_rad;
    double v_m_s, side_m_s, yaw_rad_s;
} ros_doubt_t;

/// Returns the standard deviations of pose and speed. They consist of independent parts: whole ticks; 1 % of the
/// distance with a confirmed radius or track, 4 % with an assumed one; 2 % for slip, which the wheels do not measure;
/// and a heading that drifts by 0.005 rad on the first metre. The position is known to 5 % of a straight path up to 50
/// m; a turn costs up to 6 % of its angle. The deviation of the heading is at most pi. `v_m_s`, `yaw_rad_s`: the
/// present speed.
ros_doubt_t ros_odometry_doubt(const ros_odometry_t *self, const ros_measures_t *measures, double v_m_s,
                               double yaw_rad_s);

#endif
