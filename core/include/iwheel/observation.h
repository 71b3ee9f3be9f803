// SPDX-License-Identifier: MIT
/// @file
/// Observations of the wheels' motion for the assumption store. The core itself observes force units, offset, feedback
/// signs and lengths of frames.
///
/// This module is optional. It reads the snapshot and writes through `iw_gateway_set_assumption`; a program that does
/// not call it does not link it. No safety rule depends on it.
///
/// - Gear ratio: compares the ticks with the turns by rpm while a wheel turns in one direction, not too slowly.
/// - Byte order of the pose: in the right byte order the pose moves in small steps, in the wrong one in large steps.
/// - Setpoint type: a wheel runs steadily at its commanded speed.
///
/// It reads no clock and stores no frame. We chose the thresholds.
#ifndef IW_OBSERVATION_H
#define IW_OBSERVATION_H

#include "iwheel/snapshot.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The gear ratio is judged only above this speed (geometric mean of two frames): the resolution of 1 rpm is 10 % of
/// it.
#define IW_OBSERVATION_RPM 10
/// Shortest stretch for the gear ratio: one rotor turn.
#define IW_OBSERVATION_TICKS 60
/// Longest stretch without a status message, in rpm x us (100000 ticks). After it the stretch begins again.
#define IW_OBSERVATION_TURNED_MAX 100000000000
/// The gear ratio fits if the ticks are within this share of the turns by rpm ...
#define IW_OBSERVATION_FITS_PERMILLE  120
#define IW_OBSERVATION_FAILS_PERMILLE 250 ///< ... and does not fit beyond this share. Between them there is no result.
/// Number of stretches in a row that must not fit: a frame may be lost.
#define IW_OBSERVATION_MISSES 3U
/// A longer gap between two frames starts the stretch again.
#define IW_OBSERVATION_GAP_US 100000U
/// Number of pose steps with motion that are judged ...
#define IW_OBSERVATION_POSE_STEPS 25U
#define IW_OBSERVATION_POSE_FAR   1000000 ///< ... or fewer, if both byte orders together moved by this, in mm and mrad.
/// In the wrong byte order the pose must move by this factor more.
#define IW_OBSERVATION_POSE_FACTOR 8
/// The setpoint type is confirmed by a wheel that runs at least this fast ...
#define IW_OBSERVATION_TYPE_MM_S 150
#define IW_OBSERVATION_TYPE_US   1000000U ///< ... for this time within 15 % (and 1 rpm) of its commanded speed.

/// State of one wheel.
typedef struct {
    iw_time_us_t speed_us;  ///< Time of the last speed message that was added.
    iw_time_us_t status_us; ///< Time of the last status message that was read.
    iw_time_us_t steady_us; ///< Last time at which it did not run as commanded, or the command changed.
    int64_t turned;         ///< |rpm| x us since the stretch began.
    int64_t ticks;          ///< Ticks at the beginning of the stretch.
    uint32_t reboots;       ///< Number of reboots at the beginning; a change starts the stretch again.
    uint32_t misses;        ///< Number of stretches in a row that did not fit.
    int16_t rpm;            ///< Speed in the last speed message.
    int16_t applied_mm_s;   ///< Applied speed since `steady_us`.
    bool open;              ///< A stretch has begun.
} iw_observation_wheel_t;

/// State of the observations. It belongs to the caller and is the only state of this module.
typedef struct {
    iw_observation_wheel_t wheel[IW_SIDES]; ///< The wheels, indexed by iw_side_t.
    iw_time_us_t pose_us;                   ///< Time of the last pose that was read; IW_NEVER if there is none.
    iw_codec_pose_t pose;                   ///< That pose.
    uint32_t pose_steps;                    ///< Number of steps with motion.
    int32_t moved;                          ///< Motion in these steps, in the assumed byte order.
    int32_t reversed;                       ///< Motion in these steps, in the other byte order.
} iw_observation_t;

/// Initializes `self` without observations.
void iw_observation_init(iw_observation_t *self);

/// Observes the last step and sets assumptions of the gateway. Call it after each step; `seen`: snapshot since that
/// step.
void iw_observation_step(iw_observation_t *self, struct iw_gateway *gateway, const iw_snapshot_t *seen);

#ifdef __cplusplus
}
#endif
#endif
