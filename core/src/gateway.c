// SPDX-License-Identifier: MIT
#include "iwheel/gateway.h"

#include "arithmetic.h"
#include "iwheel/private/current.h"

#include <string.h>

/// Sources of the assumptions before any measurement.
static void assume(iw_gateway_t *self) {
    const iw_config_t *const config = &self->config;
    iw_assumption_store_t *const assumptions = &self->assumptions;
    iw_assumption_init(assumptions);
    if (config->setpoint_type_set) {
        iw_assumption_assume(assumptions, IW_ASSUMPTION_SETPOINT_TYPE, IW_SOURCE_CONFIGURATION);
    }
    if (config->current_role != IW_ROLE_UNSET) {
        iw_assumption_assume(assumptions, IW_ASSUMPTION_CURRENT_ROLE, IW_SOURCE_CONFIGURATION);
    }
    if (config->track_mm != 0U) {
        iw_assumption_assume(assumptions, IW_ASSUMPTION_TRACK, IW_SOURCE_CONFIGURATION);
    }
    if (config->force_unit[IW_LEFT] != IW_FORCE_CN) {
        iw_assumption_assume(assumptions, IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_SOURCE_CONFIGURATION);
    }
    if (config->force_unit[IW_RIGHT] != IW_FORCE_DN) {
        iw_assumption_assume(assumptions, IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_SOURCE_CONFIGURATION);
    }
}

static IW_APART void init_wheel(iw_gateway_t *self, iw_side_t side, iw_time_us_t now_us) {
    iw_wheel_init(&self->wheel[side], &self->config, side, now_us);
    iw_force_init(&self->force[side], self->config.force_unit[side]);
    iw_follow_init(&self->follow[side], &self->config);
}

iw_config_fault_t iw_gateway_init(iw_gateway_t *self, const iw_config_t *config, const iw_hal_t *hal,
                                  iw_time_us_t now_us, bool restarted) {
    const iw_config_fault_t fault = iw_config_check(config);
    if (fault != IW_CONFIG_OK) {
        return fault;
    }
    // Copies the configuration before it initializes the parts, because they point to the copy.
    memset(self, 0, sizeof *self);
    memcpy(&self->config, config, sizeof self->config);
    memcpy(&self->hal, hal, sizeof self->hal);
    self->promised_us = now_us;
    self->pose_us = IW_NEVER;
    self->purged_us = IW_NEVER;
    init_wheel(self, IW_LEFT, now_us);
    init_wheel(self, IW_RIGHT, now_us);
    iw_diverge_init(&self->diverge, &self->config);
    iw_rolling_init(&self->rolling);
    iw_permit_init(&self->permit, &self->config, now_us, restarted);
    iw_setpoint_init(&self->setpoint, &self->config);
    iw_sender_init(&self->sender, &self->config, &self->hal);
    assume(self);
    return IW_CONFIG_OK;
}

void iw_gateway_suspended(iw_gateway_t *self, iw_time_us_t for_us) {
    self->suspended_us += for_us;
}

void iw_gateway_bus_facts(iw_gateway_t *self, const iw_bus_facts_t *facts) {
    self->facts = *facts;
}

iw_refusal_t iw_gateway_arm(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover) {
    // A latch is reported first: it must be reset before anything else can be fixed.
    if (iw_permit_state(&self->permit) != IW_STATE_LATCHED && self->assumptions.doubt != IW_ASSUMPTION_ITEMS) {
        return IW_REFUSE_CONTRADICTED;
    }
    const bool held = self->permit.holder == client;
    const iw_refusal_t refusal = iw_permit_arm(&self->permit, now_us, client, takeover);
    if (refusal == IW_REFUSE_NONE && !held) {
        // R3: an earlier command has no effect, even without a step in between.
        iw_setpoint_collapse(&self->setpoint, now_us);
    }
    return refusal;
}

/// Scales both values by one factor, so that the larger one is `limit` and the curve remains. Returns true if it scaled
/// them.
static IW_APART bool scale_pair(int32_t values[IW_SIDES], int32_t limit) {
    const int32_t left = iw_abs(values[IW_LEFT]);
    const int32_t right = iw_abs(values[IW_RIGHT]);
    const int32_t largest = (left > right) ? left : right;
    if (largest <= limit) {
        return false;
    }
    values[IW_LEFT] = values[IW_LEFT] * limit / largest;
    values[IW_RIGHT] = values[IW_RIGHT] * limit / largest;
    return true;
}

/// Checks the values of a request, independent of its client.
static iw_refusal_t refuse_values(const iw_config_t *config, const iw_drive_t *request) {
    // A current limit has no sign.
    const int32_t lowest_mA = (config->current_role == IW_ROLE_SETPOINT) ? -IW_CURRENT_LIMIT_mA : 0;
    for (size_t side = 0; side < IW_SIDES; side++) {
        if (request->speed_mm_s[side] < INT16_MIN || request->speed_mm_s[side] > INT16_MAX) {
            return IW_REFUSE_OUT_OF_RANGE;
        }
        if (request->has_current &&
            (request->current_mA[side] < lowest_mA || request->current_mA[side] > IW_CURRENT_LIMIT_mA)) {
            return IW_REFUSE_OUT_OF_RANGE;
        }
    }
    const bool missing = !request->has_current && config->current_role == IW_ROLE_SETPOINT;
    return missing ? IW_REFUSE_MISSING_FIELD : IW_REFUSE_NONE;
}

static IW_APART bool drive_nonzero(const iw_config_t *config, const iw_drive_t *request) {
    const bool speed = request->speed_mm_s[IW_LEFT] != 0 || request->speed_mm_s[IW_RIGHT] != 0;
    const bool current =
        request->has_current && (request->current_mA[IW_LEFT] != 0 || request->current_mA[IW_RIGHT] != 0);
    return speed || (current && config->current_role == IW_ROLE_SETPOINT);
}

/// Scales a command that is too fast instead of refusing it: its direction is right, and a refusal would let the lease
/// run out.
static iw_applied_t limit_drive(const iw_config_t *config, const iw_yaw_t *yaw, const iw_drive_t *request) {
    iw_drive_t drive = *request;
    iw_applied_t applied;
    if (!drive.has_current) {
        drive.current_mA[IW_LEFT] = config->max_current_mA;
        drive.current_mA[IW_RIGHT] = config->max_current_mA;
    }
    applied.limited = iw_yaw_limit(yaw, drive.speed_mm_s);
    applied.limited = scale_pair(drive.speed_mm_s, config->max_speed_mm_s) || applied.limited;
    applied.limited = scale_pair(drive.current_mA, config->max_current_mA) || applied.limited;
    if (config->current_role == IW_ROLE_LIMIT) {
        const bool zero = drive.speed_mm_s[IW_LEFT] == 0 && drive.speed_mm_s[IW_RIGHT] == 0;
        applied.limited = iw_current_limit(config, drive.current_mA, zero) || applied.limited;
    }
    for (size_t side = 0; side < IW_SIDES; side++) {
        applied.pair.wheel[side].speed_mm_s = (int16_t)drive.speed_mm_s[side];
        applied.pair.wheel[side].current_mA = (int16_t)drive.current_mA[side];
    }
    return applied;
}

iw_refusal_t iw_gateway_drive(iw_gateway_t *self, iw_time_us_t sent_us, iw_client_t client, const iw_drive_t *request,
                              iw_applied_t *out_applied) {
    const iw_config_t *const config = &self->config;
    const bool nonzero = drive_nonzero(config, request);
    const iw_refusal_t wrong = refuse_values(config, request);
    if (wrong != IW_REFUSE_NONE) {
        // A request that is refused for its values still shows that a client wants motion: arm and reset are refused
        // for some time.
        if (nonzero) {
            iw_permit_note_command(&self->permit, sent_us, client);
        }
        self->counters.out_of_range += (wrong == IW_REFUSE_OUT_OF_RANGE) ? 1U : 0U;
        return wrong;
    }
    const iw_refusal_t refusal = iw_permit_drive(&self->permit, sent_us, client, nonzero);
    if (refusal == IW_REFUSE_NONE) {
        *out_applied = limit_drive(config, &self->setpoint.yaw, request);
        iw_setpoint_command(&self->setpoint, sent_us, &out_applied->pair);
    }
    return refusal;
}

void iw_gateway_stop(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client, iw_cause_t cause) {
    iw_permit_stop(&self->permit, now_us, client, cause);
}

void iw_gateway_estop(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client) {
    const iw_event_t event = {IW_CAUSE_ESTOP_SOFTWARE, IW_SIDES_NONE, client, IW_REACT_BY_CAUSE};
    iw_permit_raise(&self->permit, &event, now_us);
}

iw_refusal_t iw_gateway_reset(iw_gateway_t *self, iw_time_us_t now_us) {
    return iw_permit_reset(&self->permit, now_us);
}

iw_refusal_t iw_gateway_release(iw_gateway_t *self) {
    return iw_permit_release(&self->permit);
}

void iw_gateway_disconnect(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client) {
    iw_permit_disconnect(&self->permit, now_us, client);
}

/// Checks whether a wheel can be tared (`judging`), or tares it.
static IW_APART iw_tare_t tare_wheel(iw_gateway_t *self, iw_side_t side, iw_time_us_t now_us, bool judging) {
    iw_force_t *const force = &self->force[side];
    return judging ? iw_force_may_tare(force, now_us) : iw_force_tare(force, now_us);
}

iw_tare_t iw_gateway_tare(iw_gateway_t *self, iw_time_us_t now_us, uint8_t sides, iw_side_t *out_side) {
    // R9: a request is applied as a whole or not at all. The first pass checks both wheels, the second one changes
    // them.
    for (uint32_t i = 0; i < 2U * IW_SIDES; i++) {
        const uint32_t side = i % IW_SIDES;
        const bool wanted = (sides & (1U << side)) != 0U;
        const iw_tare_t result = wanted ? tare_wheel(self, (iw_side_t)side, now_us, i < IW_SIDES) : IW_TARE_OK;
        if (result != IW_TARE_OK) {
            *out_side = (iw_side_t)side;
            return result;
        }
    }
    return IW_TARE_OK;
}

void iw_gateway_restore_offset(iw_gateway_t *self, iw_side_t side, iw_offset_provenance_t provenance,
                               int32_t offset_mN) {
    iw_force_restore(&self->force[side], provenance, offset_mN);
}

void iw_gateway_set_assumption(iw_gateway_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *entry) {
    if (entry->state == IW_CONTRADICTED) {
        iw_assumption_contradict(&self->assumptions, item, entry->source, entry->figure);
    } else if (entry->state == IW_CONFIRMED) {
        iw_assumption_confirm(&self->assumptions, item, entry->source, entry->figure);
    }
}
