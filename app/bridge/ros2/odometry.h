// SPDX-License-Identifier: MIT
/// Where the machine is, from how far its wheels have turned (REP-103: m, rad, x forward, y to the left). Pure.
///
/// Integrated from the distances that the gateway counts in ticks, never from speeds: what a late or lost message leaves out, the next one
/// brings. The heading comes from the whole ways since the start, so that it does not drift by rounding. It starts anew at 0 0 0, with a
/// jump, only when the distances do: further than a wheel can have come since the last message.
#ifndef ROS2_ODOMETRY_H
#define ROS2_ODOMETRY_H

#include <stdbool.h>
#include <stdint.h>

/// No wheel of this kind is faster.
#define ROS_ODOMETRY_MAX_MM_S 6000

typedef struct {
    int64_t t_us;
    int64_t left_mm;
    int64_t right_mm;
} ros_ways_t;

/// How much of the machine's measures is known.
typedef struct {
    bool radius_confirmed;
    bool track_confirmed;
    double tick_m;  ///< Way of one odometry tick, above 0.
    double track_m; ///< Above 0 for every call; 0: not configured, and there is no odometry.
} ros_measures_t;

typedef struct {
    bool begun;
    ros_ways_t start;
    ros_ways_t last;
    double x_m, y_m, yaw_rad;
    double path_m;      ///< Way of the middle, forwards and backwards alike.
    double turned_rad;  ///< The same for turning, without what the ticks alone can show on a straight way.
    double settled_rad; ///< Heading up to which turning has been counted: within a tick of `yaw_rad`.
    unsigned restarts;  ///< Jumps so far.
} ros_odometry_t;

void ros_odometry_step(ros_odometry_t *self, const ros_ways_t *ways, const ros_measures_t *measures);

/// Standard deviations.
typedef struct {
    double x_m, y_m, yaw_rad;
    double v_m_s, side_m_s, yaw_rad_s;
} ros_doubt_t;

/// Of pose and speed, from independent parts: whole ticks; 1 % of the way with a confirmed radius or track, 4 % with an assumed one; 2 % for
/// slip, which nobody measures; and a heading that drifts by 0.005 rad on the first metre. The place is known to 5 % of a straight way up to
/// 50 m; a turn costs up to 6 % of its angle. The heading's is at most pi. `v_m_s`, `yaw_rad_s`: the speed now.
ros_doubt_t ros_odometry_doubt(const ros_odometry_t *self, const ros_measures_t *measures, double v_m_s,
                               double yaw_rad_s);

#endif
