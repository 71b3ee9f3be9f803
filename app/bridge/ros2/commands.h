// SPDX-License-Identifier: MIT
/// What a command from the network says, and when the bridge may ask for the lease by itself. Pure: no clock, no I/O.
#ifndef ROS2_COMMANDS_H
#define ROS2_COMMANDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// So long nobody may have wanted to move before the bridge arms by itself; the gateway demands the same.
#define ROS_QUIET_US 500000
/// So long no command at all came, and its source counts as silent.
#define ROS_SILENT_US 1000000

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
///        |                                                                     ^
///        +--a person's stop--> STOPPED --a command--> RESUMED --no command for ROS_SILENT_US--> TRUSTED
///                                |                        |
///                                +------------------------+--a stop that was not ours--> WAITING
///
/// A person's stop is one that came by the bridge, also while the machine stands, when the gateway has nothing to stop. The service arms in
/// every state, and leads to TRUSTED. Ours is a stop because our own source fell silent. In TRUSTED one command after ROS_QUIET_US of zeros or
/// silence asks for the lease.
typedef enum { ROS_AUTO_TRUSTED = 0, ROS_AUTO_WAITING, ROS_AUTO_STOPPED, ROS_AUTO_RESUMED } ros_auto_state_t;

typedef struct {
    ros_auto_state_t state;
    int64_t moved_us;    ///< When a command that was none of zero came last, passed or not,
    int64_t received_us; ///< and any command.
    int64_t tried_us;
} ros_auto_t;

void ros_auto_init(ros_auto_t *self, int64_t now_us);

/// A command came; `moves`: it is not of zero, or not readable. True: ask for the lease with it, if nobody has it and the gateway listens.
bool ros_auto_command(ros_auto_t *self, bool moves, int64_t now_us);

/// The wheels were stopped, or may have been.
void ros_auto_stopped(ros_auto_t *self, bool by_our_silence);

/// A person asked to stop, in whatever state the machine is.
void ros_auto_person_stopped(ros_auto_t *self);

/// Somebody armed by the service: a person's decision.
void ros_auto_told(ros_auto_t *self);

#endif
