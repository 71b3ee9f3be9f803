// SPDX-License-Identifier: MIT
/// One gateway for the tests of the core: each test begins with a new one, and fails if the judge has seen a violation.
#ifndef TEST_GATEWAY_CORE_RIG_H
#define TEST_GATEWAY_CORE_RIG_H

#include "gateway_rig.h"
#include "message.h"

extern gateway_rig_t rig;

iw_state_t state(void);

/// Returns the last stop.
const iw_stop_t *stop(void);

/// Arms and drives straight ahead with 400 mm/s.
void drive_on(void);

/// Arms, and commands these speeds for that long.
void arm_and_cruise(int32_t left_mm_s, int32_t right_mm_s, iw_time_us_t for_us);

/// Makes the next step this much later than the gateway requested.
void stall_by(iw_time_us_t late_us);

/// Turns a wheel with this speed, whatever is commanded.
void turn(size_t side, int16_t rpm);

/// Neither wheel sends anything, or both send again.
void set_mute(bool mute);

/// A wheel sends this message.
void put(const message_t *message);

#endif
