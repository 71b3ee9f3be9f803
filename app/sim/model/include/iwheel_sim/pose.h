// SPDX-License-Identifier: MIT
/// The pose that the right wheel computes: dead reckoning from its own way and from the left wheel's speed frames on
/// the bus.
///
/// It believes what it hears: a left wheel that is silent for more than 50 ms counts as standing still, a forged or
/// mirrored one leads it astray. Both wheels turn forward with positive speed unless told otherwise. X and Y saturate
/// at +/-32.767 m, PSI wraps at 65.536 rad (choices of this model; the document gives only the fields).
#ifndef IWHEEL_SIM_POSE_H
#define IWHEEL_SIM_POSE_H

#include "iwheel/codec.h"

/// A left wheel not heard for this long stands still.
#define SIM_POSE_SILENT_US 50000U

typedef struct {
    iw_time_us_t now_us;
    iw_time_us_t left_heard_us;
    int64_t left_nm; ///< Way of the left wheel not yet in the pose.
    int64_t right_last_nm;
    int64_t x_nm;
    int64_t y_nm;
    int64_t psi_nrad;
    int32_t left_um_s;
    uint16_t track_mm;       ///< Between the wheels, as the right wheel believes.
    bool mirrored[IW_SIDES]; ///< Mounted so that its positive speed goes backwards.
} sim_pose_t;

/// Starts at 0, 0 with heading 0. `right_nm` is the right wheel's own way so far. Keeps no more than `track_mm` and
/// `mirrored`.
void sim_pose_restart(sim_pose_t *self, iw_time_us_t now_us, int64_t right_nm);

/// The left wheel's speed was heard.
void sim_pose_receive_left(sim_pose_t *self, iw_time_us_t now_us, int32_t speed_um_s);

/// Brings the pose up to now and tells it.
iw_codec_pose_t sim_pose_step(sim_pose_t *self, iw_time_us_t now_us, int64_t right_nm);

#endif
