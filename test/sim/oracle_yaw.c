// SPDX-License-Identifier: MIT
// Turning of the machine by the pair: the command, the setpoints, and the rise of the turning speed.
#include "oracle_parts.h"

#include <stdlib.h>

/// Radius for which a setpoint means its speed.
#define FIRMWARE_RADIUS_MM 192
/// Two speeds, each truncated to a whole mm/s.
#define ROUNDING_MM_S 2

/// Turning speed of the real machine for a difference of setpoints, in thousandths of a mrad/s, times the track.
static int64_t turns_um_s(const oracle_t *self, int64_t difference_mm_s) {
    return llabs(difference_mm_s) * 1000 * self->config->radius_mm / FIRMWARE_RADIUS_MM;
}

static int64_t most_um_s(const oracle_t *self) {
    return (int64_t)self->config->max_yaw_mrad_s * self->config->track_mm;
}

/// True if the excess is more than the fraction of a mm/s that a division drops.
bool oracle_turns_too_fast(const oracle_t *self, int32_t left_mm_s, int32_t right_mm_s) {
    return turns_um_s(self, (int64_t)right_mm_s - left_mm_s) > most_um_s(self);
}

static int64_t ahead(const oracle_t *self, size_t side, int32_t speed) {
    return self->config->invert[side] ? -(int64_t)speed : (int64_t)speed;
}

/// True if both setpoints of a pair were passed to the port in this step.
void oracle_judge_turn(oracle_t *self, iw_time_us_t now_us) {
    const oracle_wheel_t *const left = &self->wheel[IW_LEFT];
    const oracle_wheel_t *const right = &self->wheel[IW_RIGHT];
    const iw_time_us_t span_us = now_us - self->turn_us;
    const iw_time_us_t granted_us = oracle_us(2U * self->config->period_ms);
    if (!left->tried_now || !right->tried_now) {
        return;
    }
    const int64_t before = llabs(ahead(self, IW_RIGHT, right->before) - ahead(self, IW_LEFT, left->before));
    const int64_t turn = llabs(ahead(self, IW_RIGHT, right->speed) - ahead(self, IW_LEFT, left->speed));
    const int64_t counted_us = (int64_t)((span_us < granted_us) ? span_us : granted_us);
    const int64_t grown = turn - before - ROUNDING_MM_S;
    self->turn_us = now_us;
    if (!left->accepted_now || !right->accepted_now) {
        return; // Another rule is broken, or the next pair is zero.
    }
    if (turns_um_s(self, turn) > most_um_s(self)) {
        oracle_break(self, now_us, 813, "turns too fast: %lld mm/s between the wheels", (long long)turn);
    }
    if (grown > 0 && turns_um_s(self, grown) * 1000000 >
                         (int64_t)self->config->yaw_accel_mrad_s2 * self->config->track_mm * counted_us) {
        oracle_break(self, now_us, 814, "turns faster too soon: %lld to %lld mm/s between the wheels within %llu us",
                     (long long)before, (long long)turn, (unsigned long long)span_us);
    }
}
