// SPDX-License-Identifier: MIT
// Wheels that turn although nothing is sent to them are detected, and no other situation is reported as such.
#include "oracle_parts.h"

#include <stdlib.h>

#define ROLLING_US (300U * MS)
/// Additional time for a condition that must last: the time between steps.
#define MARGIN_US (70U * MS)
#define AFTER_US  (10000U * MS)

static bool turns(const oracle_t *self, iw_time_us_t now_us, int32_t mm_s) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        const oracle_wheel_t *const wheel = &self->wheel[side];
        const bool online = wheel->fresh_us != IW_NEVER &&
                            !oracle_elapsed(now_us, wheel->fresh_us, oracle_us(self->config->wheel_silent_ms));
        if (online && (int64_t)abs(wheel->rpm) * 20106 > (int64_t)mm_s * 1000) {
            return true;
        }
    }
    return false;
}

void oracle_judge_rolling(oracle_t *self, iw_time_us_t now_us) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(self->gateway, now_us, &seen);
    const bool alone = seen.demand == IW_DEMAND_SILENCE && !self->stalled && now_us - self->late_us > GAP_US;
    // Zeros are held, whether or not the bus accepts them.
    if (seen.demand != IW_DEMAND_SILENCE) {
        self->setpoint_us = now_us;
    }
    if (!alone || !turns(self, now_us, 102)) {
        self->turning_us = IW_NEVER;
    } else if (self->turning_us == IW_NEVER) {
        self->turning_us = now_us;
    }
    if (turns(self, now_us, 100)) {
        self->turned_us = now_us;
    }
    if (oracle_elapsed(now_us, self->turning_us, ROLLING_US + MARGIN_US) && !seen.rolling) {
        oracle_break(self, now_us, 714, "not detected: a wheel turns although nothing is sent to it");
    }
    if (seen.rolling && !self->stalled &&
        (self->turned_us == IW_NEVER || oracle_elapsed(now_us, self->turned_us, ROLLING_US + MARGIN_US + GAP_US)) &&
        now_us - self->late_us > ROLLING_US + GAP_US) {
        oracle_break(self, now_us, 715, "rolling although no wheel turns");
    }
    if (seen.rolling_fault && !self->rolling_fault &&
        oracle_elapsed(now_us, self->setpoint_us, AFTER_US + ROLLING_US + GAP_US)) {
        oracle_break(self, now_us, 716, "a fault of rolling long after the last setpoint");
    }
    self->rolling_fault = seen.rolling_fault;
}
