// SPDX-License-Identifier: MIT
// Currents that are limits: never too low for any torque, never unequal unless configured, and at the maximum again after any stop.
#include "oracle_parts.h"

/// 4000 mA/s, and the rounding of both ends.
#define FALL_US_PER_MA 250U
#define FALL_SLACK_MA  1

/// The lower of both configured bounds, computed independently of the core.
static int32_t lowest_mA(const iw_config_t *config) {
    return (config->max_current_mA < config->min_current_mA) ? config->max_current_mA : config->min_current_mA;
}

/// The target of a limit: the maximum without a valid command, otherwise the applied limit.
static int32_t wanted_mA(const oracle_t *self, size_t side) {
    const bool commanded =
        self->armed && self->fresh && self->ramp_us == IW_NEVER && iw_gateway_state(self->gateway) == IW_STATE_ARMED;
    return commanded ? self->target.wheel[side].current_mA : (int32_t)self->config->max_current_mA;
}

void oracle_judge_limit(oracle_t *self, iw_time_us_t now_us, size_t side, const iw_command_t *command) {
    const int32_t limit_mA = command->current_mA;
    const bool moves = command->speed_mm_s != 0;
    const oracle_wheel_t *const wheel = &self->wheel[side];
    const oracle_wheel_t *const left = &self->wheel[IW_LEFT];
    const int32_t wanted = wanted_mA(self, side);
    const int32_t fall_mA = (int32_t)((now_us - wheel->tried_us) / FALL_US_PER_MA) + FALL_SLACK_MA;
    if (self->config->current_role != IW_ROLE_LIMIT) {
        return;
    }
    if (limit_mA < lowest_mA(self->config)) {
        oracle_break(self, now_us, 809, "a limit of %d mA", limit_mA);
    }
    if (limit_mA < wanted) {
        oracle_break(self, now_us, 303, "limit %d mA although %d mA were wanted", limit_mA, wanted);
    }
    if (wheel->accepted_now || wheel->current == 0 || wheel->tried_us == IW_NEVER) {
        return; // The port refused it, or it is the first one: there is no earlier limit.
    }
    if (limit_mA < wheel->current - fall_mA) {
        oracle_break(self, now_us, 810, "the limit fell from %d to %d mA", wheel->current, limit_mA);
    }
    // A zero may always have the maximum.
    if (moves && limit_mA > wanted && limit_mA > wheel->current) {
        oracle_break(self, now_us, 811, "the limit rose to %d mA although %d mA were wanted", limit_mA, wanted);
    }
    if (side == IW_RIGHT && left->accepted_now && limit_mA != left->current && !self->config->asymmetric_current) {
        oracle_break(self, now_us, 812, "limits of %d and %d mA in one pair", left->current, limit_mA);
    }
}

/// Compares the reply to a drive with the request: as large as the larger side, within the bounds; the maximum for two zero speeds.
void oracle_judge_applied_limits(oracle_t *self, iw_time_us_t now_us, const iw_drive_t *request,
                                 const iw_applied_t *applied) {
    const iw_config_t *const config = self->config;
    const bool zero = request->speed_mm_s[IW_LEFT] == 0 && request->speed_mm_s[IW_RIGHT] == 0;
    const int32_t *const asked = request->current_mA;
    const int32_t larger = (asked[IW_LEFT] > asked[IW_RIGHT]) ? asked[IW_LEFT] : asked[IW_RIGHT];
    const bool full = zero || !request->has_current;
    const bool scaled = larger > config->max_current_mA;
    if (config->current_role != IW_ROLE_LIMIT) {
        return;
    }
    for (size_t side = 0; side < IW_SIDES; side++) {
        const int32_t got = applied->pair.wheel[side].current_mA;
        int32_t want = config->asymmetric_current ? asked[side] : larger;
        want = (want < lowest_mA(config)) ? lowest_mA(config) : want;
        want = (full || want > config->max_current_mA) ? (int32_t)config->max_current_mA : want;
        const bool fits = (config->asymmetric_current && scaled && !full) ? got <= want : got == want;
        if (!fits || (request->has_current && got != asked[side] && !applied->limited)) {
            oracle_break(self, now_us, 334, "asked for %d %d mA, applied %d mA", asked[IW_LEFT], asked[IW_RIGHT], got);
        }
    }
}
