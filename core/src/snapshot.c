// SPDX-License-Identifier: MIT
#include "iwheel/gateway.h"

// Four fields without a whole snapshot, for callers that poll between steps.

iw_state_t iw_gateway_state(const iw_gateway_t *self) {
    return iw_permit_state(&self->permit);
}

bool iw_gateway_arming(const iw_gateway_t *self) {
    return iw_permit_arming(&self->permit);
}

iw_refusal_t iw_gateway_arm_refusal(const iw_gateway_t *self) {
    return self->permit.arm_refusal;
}

bool iw_gateway_is_sending(const iw_gateway_t *self) {
    return iw_permit_demand(&self->permit) != IW_DEMAND_SILENCE;
}

/// Returns true if the operator has decided the unit or the offset against the observation. Then the wheel's offset
/// cannot be right, and only a tare makes the force valid.
static iw_force_validity_t overruled(const iw_force_t *force, iw_force_validity_t validity) {
    const bool judged = validity == IW_FORCE_UNIT_CONTRADICTED || validity == IW_FORCE_OFFSET_REMOVED;
    if (!judged) {
        return validity;
    }
    return (force->provenance == IW_OFFSET_OPERATOR) ? IW_FORCE_VALID : IW_FORCE_OFFSET_DOUBTED;
}

iw_force_validity_t iw_snapshot_force_validity(const iw_snapshot_t *self, iw_side_t side) {
    const iw_force_t *const force = self->wheel[side].force;
    const iw_assumption_entry_t *const unit = &self->assumed[iw_assumption_force_unit(side)];
    const iw_assumption_entry_t *const included = &self->assumed[IW_ASSUMPTION_OFFSET_INCLUDED];
    const iw_assumption_entry_t *const asked = (force->observation == IW_UNIT_OFFSET_REMOVED) ? included : unit;
    iw_force_validity_t validity = iw_force_validity(force, self->at_us);
    // The assumption store decides, not the force module: it also has the decisions of the operator and of earlier
    // runs.
    if (asked->source == IW_SOURCE_OPERATOR) {
        validity = overruled(force, validity);
    }
    if (validity == IW_FORCE_VALID && unit->state == IW_CONTRADICTED) {
        return IW_FORCE_UNIT_CONTRADICTED;
    }
    if (validity == IW_FORCE_VALID && included->state == IW_CONTRADICTED && force->provenance != IW_OFFSET_OPERATOR) {
        return IW_FORCE_OFFSET_REMOVED;
    }
    return validity;
}

static void read_wheel(const iw_gateway_t *self, iw_time_us_t now_us, iw_side_t side, iw_snapshot_wheel_t *out_wheel) {
    const iw_wheel_t *const wheel = &self->wheel[side];
    const uint32_t rest_us = iw_wheel_rest_us(wheel, now_us); // More than 0 only if the wheel is online.
    out_wheel->telemetry = &self->telemetry[side];
    out_wheel->force = &self->force[side];
    out_wheel->speed_us = wheel->speed_us;
    out_wheel->status_us = wheel->status_us;
    out_wheel->ticks = wheel->ticks;
    out_wheel->nm_per_tick = wheel->nm_per_tick;
    out_wheel->speed_mm_s = wheel->speed_mm_s;
    out_wheel->um_s_per_rpm = wheel->um_s_per_rpm;
    out_wheel->reboots = wheel->reboots;
    out_wheel->heard = iw_wheel_online(wheel, now_us);
    out_wheel->at_rest = rest_us >= (uint32_t)self->config.rest_ms * IW_US_PER_MS;
}

static void read_permit(const iw_permit_t *permit, iw_time_us_t now_us, iw_snapshot_t *out_snapshot) {
    out_snapshot->stop = &permit->stop;
    out_snapshot->seen_us = permit->seen_us;
    out_snapshot->armed_us = permit->armed_us;
    out_snapshot->lease_until_us = permit->lease_until_us;
    out_snapshot->stale_us = permit->stale_us;
    out_snapshot->holder = permit->holder;
    out_snapshot->stale_client = permit->stale_client;
    // `quiet` avoids the loop over all causes in a step without a fault.
    out_snapshot->present = permit->quiet ? 0U : iw_permit_present(permit, now_us);
    out_snapshot->still_moving = permit->still_moving;
    out_snapshot->holding = iw_permit_holding(permit);
    out_snapshot->zeros_ending = iw_permit_ending(permit, now_us);
    out_snapshot->state = iw_permit_state(permit);
    out_snapshot->arm_refusal = permit->arm_refusal;
    out_snapshot->arming = iw_permit_arming(permit);
}

void iw_gateway_snapshot(const iw_gateway_t *self, iw_time_us_t now_us, iw_snapshot_t *out_snapshot) {
    const iw_confirmation_t *const confirmation = &self->sender.confirmation;
    out_snapshot->at_us = now_us;
    out_snapshot->config = &self->config;
    out_snapshot->counters = &self->counters;
    out_snapshot->assumed = self->assumptions.entry;
    out_snapshot->assumed_changes = self->assumptions.changes;
    out_snapshot->doubt = self->assumptions.doubt;
    read_wheel(self, now_us, IW_LEFT, &out_snapshot->wheel[IW_LEFT]);
    read_wheel(self, now_us, IW_RIGHT, &out_snapshot->wheel[IW_RIGHT]);
    out_snapshot->sent = &self->sender.sent;
    out_snapshot->stopped = self->sender.envelope.stopped;
    out_snapshot->stray_echoes = self->sender.confirmation.stray;
    read_permit(&self->permit, now_us, out_snapshot);
    out_snapshot->pose_us = self->pose_us;
    out_snapshot->waiting_us = iw_confirmation_waiting_us(confirmation);
    out_snapshot->confirmed_us = iw_confirmation_proven_us(confirmation);
    out_snapshot->demand = self->setpoint.demand;
    out_snapshot->target = self->setpoint.target;
    out_snapshot->applied = iw_setpoint_applied(&self->setpoint);
    out_snapshot->output_zero = iw_setpoint_is_zero(&self->setpoint);
    out_snapshot->pair_mm = self->diverge.path_um / 1000;
    out_snapshot->pair_largest_mm = self->diverge.largest_um / 1000;
    out_snapshot->bus = self->bus;
    out_snapshot->echo_proven = self->facts.echo_proven;
    out_snapshot->rolling = self->rolling.rolling;
    out_snapshot->rolling_fault = self->rolling.is_fault;
    out_snapshot->left_behind = self->left_behind;
}
