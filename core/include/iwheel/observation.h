// SPDX-License-Identifier: MIT
/// @file
/// Evidence for the assumption ledger that the wheels' own motion gives, beside what the core finds itself (force
/// units, offset, feedback signs, lengths of frames).
///
/// Optional: it reads through the snapshot and writes through `iw_gateway_set_assumption`, and is linked only where it
/// is called. No safety rule needs it: a controller without it drives as well.
///
/// - gear ratio: ticks moved against the turns that the rpm say, while a wheel turns one way, not too slowly
/// - byte order of the pose: read the right way round it moves in small steps, the other way round in large ones
/// - setpoint type: a wheel runs at the speed it was told, steadily
///
/// Reads no clock, keeps no frame. Thresholds are ours.
#ifndef IW_OBSERVATION_H
#define IW_OBSERVATION_H

#include "iwheel/snapshot.h"

/// A wheel slower than this (geometric mean of two frames) says too little about its ratio: 1 rpm of resolution is 10
/// %.
#define IW_OBSERVATION_RPM 10
/// One rotor turn: no shorter stretch is judged.
#define IW_OBSERVATION_TICKS 60
/// So many turns of the rpm (x us) without an end: status frames are missing, and the stretch begins anew. 100000
/// ticks.
#define IW_OBSERVATION_TURNED_MAX 100000000000
/// Ticks within this share of what the rpm say: the ratio fits. Up to the next: nothing.
#define IW_OBSERVATION_FITS_PERMILLE  120
#define IW_OBSERVATION_FAILS_PERMILLE 250 ///< Further off than this: it does not fit.
/// That often in a row it must not fit: a frame may be lost.
#define IW_OBSERVATION_MISSES 3U
/// A gap longer than this between two frames begins anew.
#define IW_OBSERVATION_GAP_US 100000U
/// So many steps of the pose in which it moved are judged.
#define IW_OBSERVATION_POSE_STEPS 25U
#define IW_OBSERVATION_POSE_FAR   1000000 ///< Fewer steps do, if read both ways they add up to this, mm and mrad.
/// So many times as far it must move, read the wrong way round.
#define IW_OBSERVATION_POSE_FACTOR 8
/// At least so fast a wheel must run to speak for the setpoint type.
#define IW_OBSERVATION_TYPE_MM_S 150
#define IW_OBSERVATION_TYPE_US   1000000U ///< For so long, within 15 % of what it is told (and 1 rpm).

/// One wheel.
typedef struct {
    iw_time_us_t speed_us;  ///< Of the last speed frame that was added.
    iw_time_us_t status_us; ///< Of the last status frame that was looked at.
    iw_time_us_t steady_us; ///< When it was last seen not to run as told, or was told something else.
    int64_t turned;         ///< |rpm| x us since the stretch began.
    int64_t ticks;          ///< Where it began.
    uint32_t reboots;       ///< As seen: a change begins the stretch anew.
    uint32_t misses;        ///< Stretches in a row that did not fit.
    int16_t rpm;            ///< Of the last speed frame.
    int16_t applied_mm_s;   ///< What it is told since `steady_us`.
    bool open;              ///< A stretch has begun.
} iw_observation_wheel_t;

/// What has been gathered. The caller's, and the only state of this module.
typedef struct {
    iw_observation_wheel_t wheel[IW_SIDES]; ///< By iw_side_t.
    iw_time_us_t pose_us;                   ///< Of the last pose that was looked at; IW_NEVER: none yet.
    iw_codec_pose_t pose;                   ///< That pose.
    uint32_t pose_steps;                    ///< Steps in which it moved.
    int32_t moved;                          ///< In those steps, as it is read.
    int32_t reversed;                       ///< Read the other way round.
} iw_observation_t;

/// Nothing gathered yet.
void iw_observation_init(iw_observation_t *self);

/// After each step: what it has brought, into what the gateway assumes. `seen`: looked at since the step.
void iw_observation_step(iw_observation_t *self, struct iw_gateway *gateway, const iw_snapshot_t *seen);

#endif
