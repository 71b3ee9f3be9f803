// SPDX-License-Identifier: MIT
#include "watch_pair.h"

#include "arithmetic.h"
#include "iwheel/gateway.h"

int32_t iw_watch_own_mm_s(const iw_gateway_t *self, size_t side) {
    const int32_t speed_um_s = self->telemetry[side].speed.speed_rpm * self->diverge.um_s_per_rpm;
    return (self->config.invert[side] ? -speed_um_s : speed_um_s) / 1000;
}

static void compare(iw_gateway_t *self, const iw_pair_t *applied) {
    iw_diverge_t *const diverge = &self->diverge;
    for (size_t side = 0; side < IW_SIDES; side++) {
        diverge->applied_mm_s[side] = applied->wheel[side].speed_mm_s;
    }
    const iw_diverge_verdict_t verdict = iw_diverge_step(diverge, self->now_us);
    if (verdict != IW_DIVERGE_NOT) {
        const iw_event_t event = {IW_CAUSE_PAIR_DIVERGES, (uint8_t)(IW_SIDES_LEFT << diverge->side),
                                  (uint32_t)iw_abs(diverge->path_um) / 1000U,
                                  (verdict == IW_DIVERGE_SLOW) ? IW_REACT_ZERO : IW_REACT_RAMP};
        iw_permit_raise(&self->permit, &event, self->now_us);
    }
}

/// Returns true if a reaction can change nothing: nothing is sent, zeros are sent, or a ramp has ended.
static bool has_ended(const iw_gateway_t *self) {
    const iw_demand_t demand = iw_permit_demand(&self->permit);
    return demand < IW_DEMAND_BRAKE || (demand == IW_DEMAND_BRAKE && iw_setpoint_is_zero(&self->setpoint));
}

void iw_watch_pair(iw_gateway_t *self, const iw_pair_t *applied, bool online) {
    iw_diverge_t *const diverge = &self->diverge;
    const bool lost = (self->permit.raised & (1U << (uint32_t)IW_CAUSE_WHEEL_LOST)) != 0U;
    iw_diverge_begin(diverge, self->permit.armed_us);
    if (has_ended(self) || self->setpoint.from_zero || lost) {
        iw_diverge_restart(diverge, self->now_us);
    } else if (online) { // A wheel that is offline only because of a late step removes no evidence against it.
        compare(self, applied);
    }
}

iw_time_us_t iw_watch_both_offline_us(const iw_gateway_t *self) {
    return iw_later(self->wheel[IW_LEFT].received_until_us, self->wheel[IW_RIGHT].received_until_us);
}

/// Returns the last time before a stall at which a wheel can have been lost. If the step was promised for the limit of
/// both wheels, the stall can have begun with the last frame of either of them, so neither was lost before.
static iw_time_us_t judged_us(const iw_gateway_t *self) {
    const bool at_limit = iw_watch_both_offline_us(self) == self->promised_us;
    return at_limit ? self->promised_us - IW_WHEEL_SPEED_PERIOD_US : self->promised_us;
}

static void excuse(iw_gateway_t *self, iw_side_t side, iw_time_us_t before_us) {
    if (!iw_wheel_lost(&self->wheel[side], before_us)) {
        iw_wheel_excuse(&self->wheel[side], self->now_us);
    }
}

void iw_watch_excuse(iw_gateway_t *self) {
    const iw_time_us_t before_us = judged_us(self);
    excuse(self, IW_LEFT, before_us);
    excuse(self, IW_RIGHT, before_us);
}
