// SPDX-License-Identifier: MIT
/// How old a command or request from ROS is, by the time at which its writer sent it. Pure: no clock, no I/O.
///
/// A writer on this machine has this machine's clock: it is judged absolutely against CLOCK_REALTIME. When that clock was set back, what was
/// sent before looks younger than it is; until it has caught up, writers are judged as those of other machines in addition, and requests are
/// refused. A step of the clock may refuse, never permit.
///
/// The clock of another machine may be any. Its writer is learned from its samples:
///
///     UNKNOWN --samples span ROS_LEARN_US by its clock and by ours, equal within 10 %--> KNOWN --a gap above ROS_GAP_US--> UNKNOWN
///
/// The span begins anew with each sample that took clearly less time than the first: samples that the network held back and delivers at once
/// teach nothing. A KNOWN writer's sample may take ROS_LATE_US longer than its fastest one; that measure rises by ROS_DRIFT_PPM, because two
/// clocks never run alike. A writer whose samples are all late by the same time cannot be told from one whose clock is wrong.
#ifndef ROS2_AGES_H
#define ROS2_AGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Judged absolutely: the oldest that passes, and how far its clock may be ahead.
#define ROS_OLD_US   500000
#define ROS_AHEAD_US 100000
#define ROS_LEARN_US 1000000
#define ROS_GAP_US   1000000
#define ROS_LATE_US  200000
/// A step of the wall clock against CLOCK_MONOTONIC.
#define ROS_STEP_US   100000
#define ROS_DRIFT_PPM 100
/// Writers remembered; of more, the one that was silent for longest is forgotten.
#define ROS_SOURCES 8U

typedef enum {
    ROS_AGE_FRESH = 0,
    ROS_AGE_LATE,      ///< Too old.
    ROS_AGE_AHEAD,     ///< Sent in the future.
    ROS_AGE_OVERTAKEN, ///< A later one of this writer was judged before.
    ROS_AGE_UNKNOWN,   ///< The writer's clock is not known yet, or never.
    ROS_AGE_DOUBTED    ///< A request, and the wall clock of this machine was set back.
} ros_age_t;

/// One moment by both clocks of this machine.
typedef struct {
    int64_t mono_us; ///< CLOCK_MONOTONIC.
    int64_t wall_us; ///< CLOCK_REALTIME.
} ros_moment_t;

typedef struct {
    uint64_t source;     ///< The writer; 0: unused.
    int64_t least_us;    ///< Smallest reception minus sending.
    int64_t received_us; ///< Reception of its last sample, CLOCK_MONOTONIC.
    int64_t sent_us;     ///< Sending of it, by the writer's clock, as the next two.
    int64_t first_sent_us;
    int64_t first_received_us; ///< Reception of the one with which the span begins.
    bool known;
} ros_source_t;

typedef struct {
    bool local;               ///< Every writer is on this machine.
    bool synchronised;        ///< The clocks of the other machines are kept equal to this one's.
    int64_t offset_us;        ///< CLOCK_REALTIME minus CLOCK_MONOTONIC, when it was read last.
    int64_t doubted_until_us; ///< By the wall clock, which was set back.
    ros_source_t sources[ROS_SOURCES];
} ros_ages_t;

void ros_ages_init(ros_ages_t *self, bool local, bool synchronised, ros_moment_t now);

/// Judges one command of a writer, sent at `sent_us` by its clock. Call it for each, in the order of reception. `*out_age_us` is the age it
/// was judged by.
ros_age_t ros_ages_command(ros_ages_t *self, uint64_t source, int64_t sent_us, ros_moment_t now, int64_t *out_age_us);

/// Judges one request: its writer has often sent nothing before, so it is judged absolutely or not at all (ROS_AGE_UNKNOWN).
ros_age_t ros_ages_request(ros_ages_t *self, int64_t sent_us, ros_moment_t now, int64_t *out_age_us);

#endif
