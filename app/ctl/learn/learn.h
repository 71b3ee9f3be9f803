// SPDX-License-Identifier: MIT
/// What a recording of another controller tells about the wheels that their document leaves open: setpoint types, ranges, lengths,
/// periods, what speaks for or against the documented units. In constant memory; frames come one by one.
///
/// Nothing here decides: figures and evidence, and where there is none, that there is none. What a sentence claims was
/// seen, all of it: whoever reads it drives a person with it (learn_findings.h).
#ifndef LEARN_H
#define LEARN_H

#include "candump.h"

#include "iwheel/codec.h"

#define LEARN_IDS 11U
/// Other ids told one by one.
#define LEARN_OTHERS_MAX 32U
/// Periods are counted by the millisecond up to this.
#define LEARN_PERIOD_MAX_MS 2000U

/// A range of values. Nothing: low > high.
typedef struct {
    int32_t low;
    int32_t high;
} learn_range_t;

/// Spacing of the frames of one id.
typedef struct {
    int64_t last_us; ///< -1: none yet.
    int64_t longest_us;
    uint64_t counted;
    uint32_t histogram[LEARN_PERIOD_MAX_MS + 1U]; ///< By the millisecond, rounded; the last: all that are longer.
} learn_period_t;

typedef struct {
    uint32_t id;
    bool extended;
    uint64_t count;
    learn_range_t length;
    learn_period_t period;
} learn_id_t;

/// What one wheel was told.
typedef struct {
    uint64_t count;
    uint64_t sent; ///< Marked as sent by the program that recorded it.
    uint64_t type[256];
    uint64_t type_moving[256]; ///< With a speed that is not 0.
    uint64_t at_rest;          ///< With speed 0.
    uint64_t forward;          ///< With a positive speed.
    uint64_t backward;         ///< With a negative speed.
    learn_range_t speed_mm_s;
    learn_range_t current_mA;
    learn_range_t current_at_rest_mA;  ///< With speed 0.
    learn_range_t current_forward_mA;  ///< With a positive speed.
    learn_range_t current_backward_mA; ///< With a negative speed.
    uint64_t padding;                  ///< Frames with a byte behind the documented five that is not 0.
    uint64_t over_limit;               ///< Frames with a current outside the documented range.
    uint64_t changes_of_type;          ///< From one frame to the next.
    iw_codec_setpoint_t last;
    int64_t last_us;
    int64_t steady_since_us; ///< Speed and current are these since then, without a gap in which the wheel would stop.
} learn_setpoint_t;

/// What the speed frames of a wheel showed while it was told one steady speed in one direction, long enough to have
/// reached it: for how long, without gaps.
typedef struct {
    int64_t with_us;    ///< It turned with the sign that it was told.
    int64_t against_us; ///< It turned the other way.
    int64_t still_us;   ///< It did not turn.
} learn_answer_t;

/// What one wheel showed.
typedef struct {
    uint64_t speeds; ///< Speed frames.
    learn_answer_t forward;
    learn_answer_t backward;
    int64_t stood_us;      ///< For how long it rested while told 0 with a current, long enough to have stopped.
    int64_t ran_us;        ///< The same, but it turned.
    int64_t steady_us;     ///< For how long it turned while told a steady speed.
    int64_t steady_fit_us; ///< Of these, with the rpm of a radius of 192 mm and no gear.
    int64_t steady_mm_s;   ///< Sum of what it was told then, frame by frame, as magnitude.
    int64_t steady_rpm;    ///< Sum of what it showed, as magnitude.
    int32_t rpm;           ///< The last.
    int64_t rpm_us;        ///< When; -1: never.
    int64_t rest_since_us; ///< -1: it turns.
    uint64_t statuses;     ///< Status frames.
    int64_t
        turned_rpm_us; ///< Integral of |rpm| over us, from status frame to status frame, where it turned all the time.
    int64_t pending_rpm_us;
    int64_t pending_us; ///< Time that speed frames cover, since the last status frame.
    bool pending_slow;  ///< It turned too slowly for its rpm to be exact, or the other way.
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

/// Way of the pose from frame to frame, most significant byte first and the other way round.
typedef struct {
    uint64_t count;
    uint64_t moves; ///< Times that it was another than just before.
    uint64_t way_big;
    uint64_t way_little;
    int64_t last_us;
    uint8_t last[8];
} learn_pose_t;

typedef struct {
    uint64_t frames;
    uint64_t strange; ///< Known number, but remote, extended, FD.
    uint64_t errors;  ///< The controller's error reports.
    uint64_t too_short;
    uint64_t backwards; ///< Times that go back.
    int64_t first_us;
    int64_t last_us;
    learn_id_t known[LEARN_IDS];
    learn_id_t other[LEARN_OTHERS_MAX];
    uint32_t others;
    uint64_t more_others; ///< Frames of other ids for which there was no room.
    learn_setpoint_t setpoint[IW_SIDES];
    learn_wheel_t wheel[IW_SIDES];
    learn_pose_t pose;
} learn_t;

void learn_init(learn_t *self);
void learn_frame(learn_t *self, const candump_t *frame);

/// The middle period in ms; 0 if fewer than three frames came.
uint32_t learn_period_ms(const learn_period_t *period);

/// A recording of that id; NULL if the document has no such id.
const learn_id_t *learn_known(const learn_t *self, uint32_t id);

#endif
