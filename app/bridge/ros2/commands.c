// SPDX-License-Identifier: MIT
#include "commands.h"

#include <math.h>

#define TWIST_MAX 32767.5 // Rounds to 32767.

ros_twist_verdict_t ros_twist_read(const double linear[3], const double angular[3], ros_twist_t *out_twist) {
    for (size_t i = 0; i < 3U; i++) {
        if (!isfinite(linear[i]) || !isfinite(angular[i])) {
            return ROS_TWIST_NO_NUMBER;
        }
    }
    if (fabs(linear[0] * 1000.0) >= TWIST_MAX || fabs(angular[2] * 1000.0) >= TWIST_MAX) {
        return ROS_TWIST_TOO_LARGE;
    }
    *out_twist = (ros_twist_t){.v_mm_s = (int32_t)lround(linear[0] * 1000.0),
                               .yaw_mrad_s = (int32_t)lround(angular[2] * 1000.0)};
    return ROS_TWIST_GOOD;
}

void ros_auto_init(ros_auto_t *self, int64_t now_us) {
    *self = (ros_auto_t){.state = ROS_AUTO_TRUSTED, .moved_us = now_us, .received_us = now_us, .tried_us = now_us};
}

static ros_auto_state_t state_after_command(const ros_auto_t *self, int64_t now_us) {
    switch (self->state) {
    case ROS_AUTO_STOPPED:
        return ROS_AUTO_RESUMED;
    case ROS_AUTO_RESUMED:
        return (now_us - self->received_us >= ROS_SILENT_US) ? ROS_AUTO_TRUSTED : ROS_AUTO_RESUMED;
    default:
        return self->state;
    }
}

bool ros_auto_command(ros_auto_t *self, bool moves, int64_t now_us) {
    const bool quiet = now_us - self->moved_us >= ROS_QUIET_US;
    self->state = state_after_command(self, now_us);
    self->received_us = now_us;
    if (moves) {
        self->moved_us = now_us;
    }
    // One attempt per ROS_QUIET_US: a gateway that refuses does not receive a request with each command.
    if (self->state != ROS_AUTO_TRUSTED || !quiet || now_us - self->tried_us < ROS_QUIET_US) {
        return false;
    }
    self->tried_us = now_us;
    return true;
}

void ros_auto_stopped(ros_auto_t *self, bool by_our_silence) {
    if (!by_our_silence) {
        self->state = ROS_AUTO_WAITING;
    }
}

void ros_auto_person_stopped(ros_auto_t *self) {
    self->state = (self->state == ROS_AUTO_WAITING) ? ROS_AUTO_WAITING : ROS_AUTO_STOPPED;
}

void ros_auto_reported(ros_auto_t *self) {
    self->state = ROS_AUTO_TRUSTED;
}
