// SPDX-License-Identifier: MIT
/// Judges the age of a command or request from ROS by the time at which its writer sent it. Pure: no clock, no I/O.
///
/// A writer on this machine uses this machine's clock. The bridge judges it absolutely, against CLOCK_REALTIME. After
/// that clock was set back, samples that were sent before appear younger than they are. Until the clock has caught up,
/// the bridge also judges local writers as those of other machines, and refuses requests. A step of the clock may cause
/// a refusal, never a permission.
///
/// The clock of another machine is not known. The bridge learns it from the writer's samples:
///
///     UNKNOWN --samples span ROS_LEARN_US on both clocks, equal within 10 %--> KNOWN --gap > ROS_GAP_US--> UNKNOWN
///
/// The span begins again with each sample that needed clearly less time than the first one: a burst of samples that the
/// network held back is no measure of the clock. A sample of a KNOWN writer may need ROS_LATE_US longer than the
/// fastest sample of this writer. That measure rises by ROS_DRIFT_PPM, because two clocks never run at the same rate.
/// If all samples of a writer are late by the same time, the bridge cannot distinguish that from a wrong clock.
#ifndef ROS2_AGES_H
#define ROS2_AGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Limits of the absolute judgement: greatest age, and greatest lead of the writer's clock.
#define ROS_OLD_US   500000
#define ROS_AHEAD_US 100000
#define ROS_LEARN_US 1000000
#define ROS_GAP_US   1000000
#define ROS_LATE_US  200000
/// Smallest backward step of the wall clock against CLOCK_MONOTONIC that raises doubt.
#define ROS_STEP_US   100000
#define ROS_DRIFT_PPM 100
/// Writers stored. A new one replaces the writer whose last sample is the oldest.
#define ROS_SOURCES 8U

typedef enum {
    ROS_AGE_FRESH = 0,
    ROS_AGE_LATE,      ///< Too old.
    ROS_AGE_AHEAD,     ///< Sent in the future.
    ROS_AGE_OVERTAKEN, ///< A later sample of this writer was judged before.
    ROS_AGE_UNKNOWN,   ///< The writer's clock is not known yet, or cannot be learned.
    ROS_AGE_DOUBTED    ///< Requests only: the wall clock of this machine was set back.
} ros_age_t;

/// One moment on both clocks of this machine.
typedef struct {
    int64_t mono_us; ///< CLOCK_MONOTONIC.
    int64_t wall_us; ///< CLOCK_REALTIME.
} ros_moment_t;

typedef struct {
    uint64_t source;           ///< The writer; 0: unused.
    int64_t least_us;          ///< Smallest difference of reception and sending.
    int64_t received_us;       ///< Reception of the last sample, CLOCK_MONOTONIC.
    int64_t sent_us;           ///< Sending of the last sample, by the writer's clock.
    int64_t first_sent_us;     ///< Sending of the sample that begins the span, by the writer's clock.
    int64_t first_received_us; ///< Reception of the sample that begins the span, CLOCK_MONOTONIC.
    bool known;
} ros_source_t;

typedef struct {
    bool local;               ///< Every writer is on this machine.
    bool synchronised;        ///< NTP or PTP synchronises the clocks of the other machines with this one.
    int64_t offset_us;        ///< CLOCK_REALTIME minus CLOCK_MONOTONIC, as read last.
    int64_t doubted_until_us; ///< Wall clock time until which the bridge doubts the wall clock.
    ros_source_t sources[ROS_SOURCES];
} ros_ages_t;

void ros_ages_init(ros_ages_t *self, bool local, bool synchronised, ros_moment_t now);

/// Judges one command of a writer, sent at `sent_us` by its clock. Call it for every command, in the order of
/// reception. Writes the age that decided to `*out_age_us`.
ros_age_t ros_ages_command(ros_ages_t *self, uint64_t source, int64_t sent_us, ros_moment_t now, int64_t *out_age_us);

/// Judges one request. Its writer has often sent nothing before, so only the absolute judgement is possible; where it
/// is not valid, the result is ROS_AGE_UNKNOWN. Writes the absolute age to `*out_age_us`.
ros_age_t ros_ages_request(ros_ages_t *self, int64_t sent_us, ros_moment_t now, int64_t *out_age_us);

#endif
