// SPDX-License-Identifier: MIT
/// Converts a command from the network, and decides when the bridge may request the lease on its own. Pure: no clock,
/// no I/O.
#ifndef ROS2_COMMANDS_H
#define ROS2_COMMANDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Time without a command that moves before the bridge may arm on its own. The gateway requires the same.
#define ROS_QUIET_US 500000
/// Time without any command after which the source counts as silent.
#define ROS_SILENT_US 1000000

typedef struct {
    int32_t v_mm_s;
    int32_t yaw_mrad_s;
} ros_twist_t;

typedef enum { ROS_TWIST_GOOD = 0, ROS_TWIST_NO_NUMBER, ROS_TWIST_TOO_LARGE } ros_twist_verdict_t;

/// Converts a twist in m/s and rad/s to the units of the gateway. Refuses the whole twist, with `*out_twist` unchanged,
/// if any number is NaN or infinite, or if x or yaw is more than the gateway's request can carry (32767 mm/s or
/// mrad/s). Ignores the components that a machine with two wheels cannot execute (y, z, roll, pitch).
ros_twist_verdict_t ros_twist_read(const double linear[3], const double angular[3], ros_twist_t *out_twist);

/// Decides whether a command may arm without a call of the service (auto_arm):
///
///     TRUSTED --another's stop, connection lost while armed--> WAITING --armed by the service--> TRUSTED
///        |                                                                     ^
///        +--a person's stop--> STOPPED --a command--> RESUMED --no command for ROS_SILENT_US--> TRUSTED
///                                |                        |
///                                +------------------------+--another's stop--> WAITING
///
/// A person's stop is a stop request through the bridge, also at standstill, when the gateway has nothing to stop. A
/// stop because the bridge's own source fell silent changes nothing; every other stop counts as another's. The service
/// arms in every state, and leads to TRUSTED. In TRUSTED one command after ROS_QUIET_US of zeros or silence requests
/// the lease.
typedef enum { ROS_AUTO_TRUSTED = 0, ROS_AUTO_WAITING, ROS_AUTO_STOPPED, ROS_AUTO_RESUMED } ros_auto_state_t;

typedef struct {
    ros_auto_state_t state;
    int64_t moved_us;    ///< Reception of the last command that was not zero, forwarded or not.
    int64_t received_us; ///< Reception of the last command.
    int64_t tried_us;    ///< Last time at which a command requested the lease.
} ros_auto_t;

void ros_auto_init(ros_auto_t *self, int64_t now_us);

/// Handles a received command. `moves`: it is not zero, or not readable. Returns true if the bridge may request the
/// lease with it; the caller checks that the lease is free and that the gateway is listening.
bool ros_auto_command(ros_auto_t *self, bool moves, int64_t now_us);

/// Handles a stop of the wheels, also one that may have happened unseen. `by_our_silence`: this bridge caused it,
/// because its source fell silent.
void ros_auto_stopped(ros_auto_t *self, bool by_our_silence);

/// Handles a person's stop request, in every state of the machine.
void ros_auto_person_stopped(ros_auto_t *self);

/// Handles a successful call of the service iwheel/arm.
void ros_auto_reported(ros_auto_t *self);

#endif
