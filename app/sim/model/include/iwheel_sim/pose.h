// SPDX-License-Identifier: MIT
/// Pose that the right wheel computes: dead reckoning from its own distance and from the left wheel's speed frames on
/// the bus.
///
/// The right wheel trusts these frames. A left wheel without speed frames for more than 50 ms counts as at standstill,
/// and a forged frame or a mirrored wheel makes the pose wrong. Both wheels turn forward with positive speed unless
/// `mirrored` is set. X and Y saturate at +/-32.767 m, PSI wraps at 65.536 rad (choices of this model; the document
/// defines only the fields).
#ifndef IWHEEL_SIM_POSE_H
#define IWHEEL_SIM_POSE_H

#include "iwheel/codec.h"

/// Without a speed frame for this time, the left wheel counts as at standstill.
#define SIM_POSE_SILENT_US 50000U

typedef struct {
    iw_time_us_t now_us;
    iw_time_us_t left_received_us;
    int64_t left_nm; ///< Distance of the left wheel that is not in the pose yet.
    int64_t right_last_nm;
    int64_t x_nm;
    int64_t y_nm;
    int64_t psi_nrad;
    int32_t left_um_s;
    uint16_t track_mm;       ///< Distance between the wheels that the right wheel assumes.
    bool mirrored[IW_SIDES]; ///< The wheel is mounted so that its positive speed goes backwards.
} sim_pose_t;

/// Starts again at 0, 0 with heading 0. `right_nm` is the distance of the right wheel so far. Only `track_mm` and
/// `mirrored` are retained.
void sim_pose_restart(sim_pose_t *self, iw_time_us_t now_us, int64_t right_nm);

/// Accepts a speed of the left wheel.
void sim_pose_receive_left(sim_pose_t *self, iw_time_us_t now_us, int32_t speed_um_s);

/// Advances the pose to `now_us` and returns it.
iw_codec_pose_t sim_pose_step(sim_pose_t *self, iw_time_us_t now_us, int64_t right_nm);

#endif
