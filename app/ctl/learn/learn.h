// SPDX-License-Identifier: MIT
/// Facts about the wheels that their document leaves open, from a recording of another controller: setpoint types,
/// ranges, lengths, periods, and observations for or against the documented units. Needs constant memory: the caller
/// passes the frames one by one.
///
/// This part makes no decision. It collects figures and observations, and reports where there are none. A sentence
/// claims only what was observed, because its reader configures a machine that moves a person (learn_findings.h).
#ifndef LEARN_H
#define LEARN_H

#include "candump.h"

#include "iwheel/codec.h"

#define LEARN_IDS 11U
/// Maximum number of other ids that are reported one by one.
#define LEARN_OTHERS_MAX 32U
/// Periods are counted in milliseconds up to this value.
#define LEARN_PERIOD_MAX_MS 2000U

/// A range of values. It is empty if low > high.
typedef struct {
    int32_t low;
    int32_t high;
} learn_range_t;

/// Time between the frames of one id.
typedef struct {
    int64_t last_us; ///< Time of the last frame; -1: none yet.
    int64_t longest_us;
    uint64_t counted;
    uint32_t histogram[LEARN_PERIOD_MAX_MS + 1U]; ///< Number per millisecond, rounded; the last place: all longer.
} learn_period_t;

typedef struct {
    uint32_t id;
    bool extended;
    uint64_t count;
    learn_range_t length;
    learn_period_t period;
} learn_id_t;

/// Setpoints of one wheel.
typedef struct {
    uint64_t count;
    uint64_t sent; ///< Marked as sent by the program that recorded them.
    uint64_t type[256];
    uint64_t type_moving[256]; ///< Setpoints of this type with a speed that is not 0.
    uint64_t at_rest;          ///< Setpoints with speed 0.
    uint64_t forward;          ///< Setpoints with a positive speed.
    uint64_t backward;         ///< With a negative speed.
    learn_range_t speed_mm_s;
    learn_range_t current_mA;
    learn_range_t current_at_rest_mA;  ///< Setpoints with speed 0.
    learn_range_t current_forward_mA;  ///< Setpoints with a positive speed.
    learn_range_t current_backward_mA; ///< With a negative speed.
    uint64_t padding;                  ///< Frames with a byte after the documented five that is not 0.
    uint64_t over_limit;               ///< Frames with a current outside the documented range.
    uint64_t changes_of_type;          ///< Changes from one frame to the next.
    iw_codec_setpoint_t last;
    int64_t last_us;
    int64_t steady_since_us; ///< Same speed and current since then, without a gap that stops the wheel.
} learn_setpoint_t;

/// Time for which a wheel had each reaction, without gaps: while one steady speed in one direction was commanded, for
/// long enough to have reached it.
typedef struct {
    int64_t with_us;    ///< It turned with the commanded sign.
    int64_t against_us; ///< It turned with the opposite sign.
    int64_t still_us;   ///< It did not turn.
} learn_answer_t;

/// Telemetry of one wheel.
typedef struct {
    uint64_t speeds; ///< Speed frames.
    learn_answer_t forward;
    learn_answer_t backward;
    int64_t stood_us;      ///< Time at standstill with setpoint 0 and a current, after it had time to stop.
    int64_t ran_us;        ///< Time in which it turned in this condition.
    int64_t steady_us;     ///< Time in which it turned with a steady setpoint.
    int64_t steady_fit_us; ///< Part of it with the rpm of a radius of 192 mm and no gear.
    int64_t steady_mm_s;   ///< Sum of the commanded speeds in this time, per frame, absolute.
    int64_t steady_rpm;    ///< Sum of the measured rpm, absolute.
    int32_t rpm;           ///< Last rpm.
    int64_t rpm_us;        ///< Time of `rpm`; -1: never.
    int64_t rest_since_us; ///< Time of the standstill; -1: it turns.
    uint64_t statuses;     ///< Status frames.
    int64_t turned_rpm_us; ///< Integral of |rpm| over us between status frames in which it turned all the time.
    int64_t pending_rpm_us;
    int64_t pending_us; ///< Time since the last status frame that speed frames cover.
    bool pending_slow;  ///< The speed was too low for exact rpm, or changed its sign.
    uint64_t ticks;     ///< Sum of |steps| in that time.
    int32_t last_ticks;
    int64_t last_ticks_us;
    uint64_t forces; ///< Force frames.
    uint64_t rest_force_count;
    int64_t rest_force_sum;
    learn_range_t rest_force;
    learn_range_t force;
    uint64_t offsets;
    learn_range_t offset_dN;
} learn_wheel_t;

/// Sum of the pose's steps from frame to frame, with the most and with the least significant byte first.
typedef struct {
    uint64_t count;
    uint64_t moves; ///< Number of frames that differ from the one before.
    uint64_t way_big;
    uint64_t way_little;
    int64_t last_us;
    uint8_t last[8];
} learn_pose_t;

typedef struct {
    uint64_t frames;
    uint64_t strange; ///< Frames with a known id that are remote, extended or FD.
    uint64_t errors;  ///< Error reports of the controller.
    uint64_t too_short;
    uint64_t backwards; ///< Number of times that go back.
    int64_t first_us;
    int64_t last_us;
    learn_id_t known[LEARN_IDS];
    learn_id_t other[LEARN_OTHERS_MAX];
    uint32_t others;
    uint64_t more_others; ///< Frames of other ids for which there was no place.
    learn_setpoint_t setpoint[IW_SIDES];
    learn_wheel_t wheel[IW_SIDES];
    learn_pose_t pose;
} learn_t;

void learn_init(learn_t *self);
void learn_frame(learn_t *self, const candump_t *frame);

/// Returns the median period in ms; 0 with fewer than three frames.
uint32_t learn_period_ms(const learn_period_t *period);

/// Returns the record of an id; NULL if the document has no such id.
const learn_id_t *learn_known(const learn_t *self, uint32_t id);

#endif
