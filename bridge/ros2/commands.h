// SPDX-License-Identifier: MIT
/// Which commands from the network pass to the gateway, and when the bridge may ask for the lease by itself. Pure: no clock, no I/O.
///
/// Age. A command carries the time at which its publisher sent it, by the publisher's clock, which may be any. What it took at most to get
/// here is told by the difference to our CLOCK_MONOTONIC: it may exceed the smallest difference seen of this publisher by ROS_LATE_US.
/// The smallest one rises by ROS_DRIFT_PPM, because two clocks never run alike. A publisher that was late from its first command on cannot
/// be told from one whose clock is wrong; a clock that is set back by more makes its publisher too old until it starts anew.
#ifndef ROS2_COMMANDS_H
#define ROS2_COMMANDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ROS_LATE_US   200000
#define ROS_DRIFT_PPM 100
/// So long nobody may have wanted to move before the bridge arms by itself; the gateway demands the same.
#define ROS_QUIET_US 500000
/// Publishers remembered; of more, the one that was silent for longest is forgotten.
#define ROS_SOURCES 8U

typedef struct {
    uint64_t source;  ///< Which publisher; 0: unused.
    int64_t least_us; ///< Smallest reception minus sending.
    int64_t heard_us; ///< Reception of its last command.
    int64_t sent_us;  ///< Sending of its newest command that passed.
} ros_source_t;

typedef struct {
    ros_source_t sources[ROS_SOURCES];
} ros_age_t;

/// True if this command is young enough and none before it was sent later. `sent_us` by the publisher's clock, `now_us` by ours.
bool ros_age_pass(ros_age_t *self, uint64_t source, int64_t sent_us, int64_t now_us);

typedef struct {
    int32_t v_mm_s;
    int32_t yaw_mrad_s;
} ros_twist_t;

typedef enum { ROS_TWIST_GOOD = 0, ROS_TWIST_NO_NUMBER, ROS_TWIST_TOO_LARGE } ros_twist_verdict_t;

/// A twist in m/s and rad/s as the gateway takes it. Refused as a whole, with `*out_twist` untouched: a NaN or infinity anywhere, or more
/// than the gateway's request can carry (32767 mm/s or mrad/s). What a machine with two wheels cannot do (y, z, roll, pitch) is left out.
ros_twist_verdict_t ros_twist_read(const double linear[3], const double angular[3], ros_twist_t *out_twist);

/// Arming without being told (auto_arm):
///
///     TRUSTED --a stop that was not ours, a connection lost while armed--> WAITING --armed by the service--> TRUSTED
///
/// Ours is a stop because our own source fell silent. In TRUSTED one command after ROS_QUIET_US of zeros or silence asks for the lease.
typedef struct {
    bool trusted;
    int64_t moved_us; ///< When a command that was none of zero came last, passed or not.
    int64_t tried_us;
} ros_auto_t;

void ros_auto_init(ros_auto_t *self, int64_t now_us);

/// A command came; `moves`: it is not of zero, or not readable. True: ask for the lease with it, if nobody has it and the gateway listens.
bool ros_auto_command(ros_auto_t *self, bool moves, int64_t now_us);

/// The wheels were stopped, or may have been.
void ros_auto_stopped(ros_auto_t *self, bool by_our_silence);

/// Somebody armed by the service: a person's decision.
void ros_auto_told(ros_auto_t *self);

#endif
