// SPDX-License-Identifier: MIT
#include "iwheel/permit.h"

#include <string.h>

#define BIT(cause) (1U << (uint32_t)(cause))
/// Causes that are there as long as they are told in every step; the other latching ones are events.
#define LEVELS                                                                                                         \
    (BIT(IW_CAUSE_ESTOP_LINE) | BIT(IW_CAUSE_BUS_DOWN) | BIT(IW_CAUSE_SEND_STALLED) | BIT(IW_CAUSE_WHEEL_LOST))
#define LATCHING_ALWAYS (BIT(IW_CAUSE_ESTOP_LINE) | BIT(IW_CAUSE_ESTOP_SOFTWARE) | BIT(IW_CAUSE_INTERNAL))

IW_STATIC_ASSERT(IW_CAUSES <= 32, one_bit_per_cause);

/// So many setpoints can be un-echoed when a process dies: two of each wheel (see outbox.h).
#define LEFT_BEHIND_MAX 4U

/// True if the configuration allows sending at all.
static bool may_send(const iw_config_t *config) {
    return !config->listen_only && config->setpoint_type_set && config->current_role != IW_ROLE_UNSET;
}

void iw_permit_init(iw_permit_t *self, const iw_config_t *config, iw_time_us_t now_us, bool restarted) {
    memset(self, 0, sizeof *self);
    self->config = config;
    self->stale_us = IW_NEVER;
    for (size_t cause = 0; cause < IW_CAUSE_LOOP_LATE; cause++) {
        self->seen_us[cause] = IW_NEVER;
    }
    if (restarted && may_send(config)) {
        self->state = IW_STATE_STOPPING;
        self->cut = true;
        self->hold_us = now_us;
        self->stop.cause = IW_CAUSE_RESTART;
        self->stop.at_us = now_us;
        self->stop.number = 1;
    }
}

/// Sending zeros for a process that died: nothing but those is ours yet, so faults are remembered only.
static bool restarting(const iw_permit_t *self) {
    return self->state == IW_STATE_STOPPING && self->stop.cause == IW_CAUSE_RESTART;
}

static bool within(iw_time_us_t now_us, iw_time_us_t then_us, iw_time_us_t span_us) {
    return then_us != IW_NEVER && now_us - then_us < span_us;
}

static void grant_lease(iw_permit_t *self, iw_time_us_t now_us, iw_time_us_t span_us) {
    self->lease_from_us = now_us;
    self->lease_until_us = now_us + span_us;
}

static uint32_t unfed_ms(const iw_permit_t *self, iw_time_us_t now_us) {
    const iw_time_us_t unfed_us = now_us - self->lease_from_us;
    return ((unfed_us < UINT32_MAX) ? (uint32_t)unfed_us : UINT32_MAX) / IW_US_PER_MS;
}

static iw_refusal_t refusal_for(iw_cause_t cause) {
    switch (cause) {
    case IW_CAUSE_ESTOP_LINE:
        return IW_REFUSE_ESTOP_PRESSED;
    case IW_CAUSE_BUS_DOWN:
        return IW_REFUSE_BUS_DOWN;
    case IW_CAUSE_SECOND_MASTER:
        return IW_REFUSE_SECOND_MASTER;
    case IW_CAUSE_SEND_STALLED:
        return IW_REFUSE_SEND_STALLED;
    case IW_CAUSE_WHEEL_LOST:
        return IW_REFUSE_WHEEL_LOST;
    default:
        return IW_REFUSE_CAUSE_PRESENT;
    }
}

uint32_t iw_permit_present(const iw_permit_t *self, iw_time_us_t now_us) {
    uint32_t present = (self->present | self->raised) & LEVELS;
    for (uint32_t cause = IW_CAUSE_ESTOP_LINE; cause <= IW_CAUSE_INTERNAL; cause++) {
        if ((BIT(cause) & LEVELS) == 0U && within(now_us, self->seen_us[cause], IW_PERMIT_EVENT_US)) {
            present |= BIT(cause);
        }
    }
    return present;
}

/// The most telling of the causes present, as a refusal.
static iw_refusal_t refuse_present(const iw_permit_t *self, iw_time_us_t now_us) {
    const uint32_t present = iw_permit_present(self, now_us);
    for (uint32_t cause = IW_CAUSE_ESTOP_LINE; cause <= IW_CAUSE_INTERNAL; cause++) {
        if ((present & BIT(cause)) != 0U) {
            return refusal_for((iw_cause_t)cause);
        }
    }
    return IW_REFUSE_NONE;
}

static iw_refusal_t refuse_latched(const iw_permit_t *self, iw_time_us_t now_us) {
    const bool pressed = refuse_present(self, now_us) == IW_REFUSE_ESTOP_PRESSED;
    return pressed ? IW_REFUSE_ESTOP_PRESSED : IW_REFUSE_LATCHED;
}

static bool stale_command(const iw_permit_t *self, iw_time_us_t now_us) {
    return within(now_us, self->stale_us, IW_PERMIT_STALE_US);
}

static void end_arming(iw_permit_t *self, iw_refusal_t refusal) {
    if (self->arming) {
        self->arming = false;
        self->arm_refusal = refusal;
        self->holder = IW_CLIENT_NONE;
    }
}

/// Writes down why the wheels stop, as long as it is still known what they were told.
static void record_stop(iw_permit_t *self, iw_time_us_t now_us, iw_cause_t cause, uint8_t sides, uint32_t detail) {
    iw_stop_t *const stop = &self->stop;
    stop->at_us = now_us;
    stop->number++;
    stop->detail = detail;
    stop->client = self->holder;
    stop->applied = self->view.applied;
    stop->cause = cause;
    stop->from = self->state;
    stop->sides = sides;
    stop->latched = false;
}

static void enter_stopping(iw_permit_t *self, iw_time_us_t now_us, iw_cause_t cause, uint8_t sides, uint32_t detail) {
    record_stop(self, now_us, cause, sides, detail);
    self->state = IW_STATE_STOPPING;
    self->cut = cause == IW_CAUSE_LOOP_LATE;
    self->hold_us = IW_NEVER;
    self->holder = IW_CLIENT_NONE;
}

static void enter_latched(iw_permit_t *self, iw_time_us_t now_us, iw_cause_t cause, uint8_t sides, uint32_t detail) {
    const bool was_sending = self->state != IW_STATE_LISTENING || self->arming;
    record_stop(self, now_us, cause, sides, detail);
    self->stop.latched = true;
    end_arming(self, refusal_for(cause));
    self->state = IW_STATE_LATCHED;
    self->holding = was_sending;
    self->hold_us = now_us;
    self->holder = IW_CLIENT_NONE;
}

static bool latches(const iw_permit_t *self, iw_cause_t cause) {
    if ((BIT(cause) & LATCHING_ALWAYS) != 0U) {
        return true;
    }
    return cause < IW_CAUSE_LOOP_LATE && self->state != IW_STATE_LISTENING && !restarting(self);
}

void iw_permit_raise(iw_permit_t *self, iw_time_us_t now_us, iw_cause_t cause, uint8_t sides, uint32_t detail) {
    self->raised |= BIT(cause);
    if (cause < IW_CAUSE_LOOP_LATE) {
        self->seen_us[cause] = now_us;
    }
    if (self->state == IW_STATE_LATCHED) {
        return;
    }
    if (latches(self, cause)) {
        enter_latched(self, now_us, cause, sides, detail);
    } else if (self->state == IW_STATE_ARMED) {
        enter_stopping(self, now_us, cause, sides, detail);
    } else if (restarting(self) && cause == IW_CAUSE_SECOND_MASTER) {
        self->strangers++;
        self->state = (self->strangers > LEFT_BEHIND_MAX) ? IW_STATE_LISTENING : self->state;
    } else {
        end_arming(self, refusal_for(cause));
        self->cut = self->cut || cause == IW_CAUSE_LOOP_LATE;
    }
}

void iw_permit_keep_present(iw_permit_t *self) {
    self->raised |= self->present & (BIT(IW_CAUSE_SEND_STALLED) | BIT(IW_CAUSE_WHEEL_LOST));
}

static void step_arming(iw_permit_t *self, iw_time_us_t now_us) {
    const iw_time_us_t limit_us = (iw_time_us_t)self->config->echo_ms * IW_US_PER_MS;
    const iw_time_us_t waited_us = now_us - self->arming_us;
    if (self->view.proven && waited_us <= limit_us) {
        self->arming = false;
        self->state = IW_STATE_ARMED;
        self->armed_us = now_us;
        grant_lease(self, now_us, IW_PERMIT_FIRST_LEASE_US);
    } else if (waited_us >= limit_us) {
        end_arming(self, IW_REFUSE_SEND_STALLED);
    }
}

/// True once zeros have been held for long enough and the wheels stand, or for as long as it makes sense.
static bool hold_done(iw_permit_t *self, iw_time_us_t now_us) {
    const iw_time_us_t zero_hold_us = (iw_time_us_t)self->config->zero_hold_ms * IW_US_PER_MS;
    if (self->hold_us == IW_NEVER) {
        if (!self->cut && !self->view.output_zero) {
            return false;
        }
        self->hold_us = now_us;
    }
    const iw_time_us_t held_us = now_us - self->hold_us;
    if (held_us >= IW_PERMIT_HOLD_MAX_US) {
        self->still_moving += self->view.settled ? 0U : 1U;
        return true;
    }
    return held_us >= zero_hold_us && (self->view.settled || restarting(self));
}

void iw_permit_step(iw_permit_t *self, iw_time_us_t now_us, const iw_permit_view_t *view) {
    self->view = *view;
    self->present = self->raised;
    self->raised = 0;
    if (self->arming) {
        step_arming(self, now_us);
    }
    if (self->state == IW_STATE_ARMED && now_us >= self->lease_until_us) {
        enter_stopping(self, now_us, IW_CAUSE_LEASE_LOST, IW_SIDES_NONE, unfed_ms(self, now_us));
    } else if (self->state == IW_STATE_STOPPING && !self->arming && hold_done(self, now_us)) {
        self->state = IW_STATE_LISTENING;
    } else if (self->holding && hold_done(self, now_us)) {
        self->holding = false;
    }
}

iw_demand_t iw_permit_demand(const iw_permit_t *self) {
    switch (self->state) {
    case IW_STATE_ARMED:
        return IW_DEMAND_FOLLOW;
    case IW_STATE_STOPPING:
        return self->cut ? IW_DEMAND_ZERO : IW_DEMAND_BRAKE;
    case IW_STATE_LATCHED:
        return self->holding ? IW_DEMAND_ZERO : IW_DEMAND_SILENCE;
    case IW_STATE_LISTENING:
    default:
        return self->arming ? IW_DEMAND_ZERO : IW_DEMAND_SILENCE;
    }
}

/// What speaks against sending at all.
static iw_refusal_t refuse_sending(const iw_permit_t *self, iw_time_us_t now_us) {
    const iw_refusal_t present = refuse_present(self, now_us);
    if (self->config->listen_only) {
        return IW_REFUSE_LISTEN_ONLY;
    }
    if (self->state == IW_STATE_LATCHED) {
        return refuse_latched(self, now_us);
    }
    if (!may_send(self->config)) {
        return IW_REFUSE_TYPE_NOT_SET;
    }
    if (present != IW_REFUSE_NONE) {
        return present;
    }
    if (!self->view.timing_ok) {
        return IW_REFUSE_TIMING_MISMATCH;
    }
    if (!self->view.heard) {
        return IW_REFUSE_WHEEL_LOST;
    }
    return restarting(self) ? IW_REFUSE_CAUSE_PRESENT : IW_REFUSE_NONE;
}

/// What speaks against moving the lease to this client now.
static iw_refusal_t refuse_lease(const iw_permit_t *self, iw_time_us_t now_us, bool takeover) {
    if (self->holder != IW_CLIENT_NONE && (!takeover || self->arming)) {
        return IW_REFUSE_BUSY;
    }
    if (stale_command(self, now_us)) {
        return IW_REFUSE_STALE_COMMAND;
    }
    if (!self->view.at_rest || !self->view.output_zero) {
        return IW_REFUSE_NOT_AT_REST;
    }
    if (self->state == IW_STATE_LISTENING && !self->view.can_send) {
        return IW_REFUSE_SEND_STALLED;
    }
    return IW_REFUSE_NONE;
}

iw_refusal_t iw_permit_arm(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover) {
    if (self->holder == client) {
        return IW_REFUSE_NONE;
    }
    const iw_refusal_t sending = refuse_sending(self, now_us);
    const iw_refusal_t refusal = (sending != IW_REFUSE_NONE) ? sending : refuse_lease(self, now_us, takeover);
    if (refusal != IW_REFUSE_NONE) {
        return refusal;
    }
    self->holder = client;
    if (self->state == IW_STATE_ARMED) {
        self->armed_us = now_us;
        grant_lease(self, now_us, IW_PERMIT_FIRST_LEASE_US);
    } else {
        self->arming = true;
        self->arming_us = now_us;
        self->arm_refusal = IW_REFUSE_NONE;
    }
    return IW_REFUSE_NONE;
}

/// ARMED: only the holder drives, and only while the lease lasts, even if no step has ended it yet.
static iw_refusal_t refuse_holder(const iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client) {
    if (self->holder != client) {
        return IW_REFUSE_NOT_HOLDER;
    }
    if (sent_us < self->armed_us) {
        return IW_REFUSE_STALE_COMMAND;
    }
    return (sent_us < self->lease_until_us) ? IW_REFUSE_NONE : IW_REFUSE_NOT_ARMED;
}

static iw_refusal_t refuse_drive(const iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client) {
    const bool blocked = self->stop.cause == IW_CAUSE_WHEEL_BLOCKED && self->stop.client == client;
    switch (self->state) {
    case IW_STATE_LATCHED:
        return refuse_latched(self, sent_us);
    case IW_STATE_STOPPING:
        return blocked ? IW_REFUSE_WHEEL_BLOCKED : IW_REFUSE_NOT_ARMED;
    case IW_STATE_ARMED:
        return refuse_holder(self, sent_us, client);
    case IW_STATE_LISTENING:
    default:
        return self->config->listen_only ? IW_REFUSE_LISTEN_ONLY : IW_REFUSE_NOT_ARMED;
    }
}

void iw_permit_remember(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client) {
    if (self->stale_us == IW_NEVER || now_us >= self->stale_us) {
        self->stale_us = now_us;
        self->stale_client = client;
    }
}

iw_refusal_t iw_permit_drive(iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client, bool nonzero) {
    const iw_refusal_t refusal = refuse_drive(self, sent_us, client);
    if (nonzero) {
        iw_permit_remember(self, sent_us, client);
    }
    if (refusal == IW_REFUSE_NONE) {
        grant_lease(self, sent_us, (iw_time_us_t)self->config->lease_ms * IW_US_PER_MS);
    }
    return refusal;
}

void iw_permit_stop(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, iw_cause_t cause) {
    if (self->state == IW_STATE_ARMED) {
        enter_stopping(self, now_us, cause, IW_SIDES_NONE, 0);
        self->stop.client = client;
    }
    end_arming(self, IW_REFUSE_NOT_ARMED);
}

void iw_permit_disconnect(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client) {
    if (client != self->holder) {
        return;
    }
    if (self->state == IW_STATE_ARMED) {
        enter_stopping(self, now_us, IW_CAUSE_CLIENT_GONE, IW_SIDES_NONE, 0);
    }
    end_arming(self, IW_REFUSE_NOT_ARMED);
}

iw_refusal_t iw_permit_reset(iw_permit_t *self, iw_time_us_t now_us) {
    const iw_refusal_t present = refuse_present(self, now_us);
    if (self->state != IW_STATE_LATCHED) {
        return IW_REFUSE_NONE;
    }
    if (present != IW_REFUSE_NONE) {
        return present;
    }
    if (!self->view.heard) {
        return IW_REFUSE_WHEEL_LOST;
    }
    if (!self->view.at_rest) {
        return IW_REFUSE_NOT_AT_REST;
    }
    if (stale_command(self, now_us)) {
        return IW_REFUSE_STALE_COMMAND;
    }
    self->state = IW_STATE_LISTENING;
    self->holding = false;
    return IW_REFUSE_NONE;
}

iw_time_us_t iw_permit_next_us(const iw_permit_t *self) {
    iw_time_us_t next_us = IW_NEVER;
    const bool held = self->state == IW_STATE_STOPPING || self->holding;
    if (self->arming) {
        next_us = self->arming_us + (iw_time_us_t)self->config->echo_ms * IW_US_PER_MS;
    } else if (self->state == IW_STATE_ARMED) {
        next_us = self->lease_until_us;
    } else if (held && self->hold_us != IW_NEVER) {
        const bool first = self->view.settled || restarting(self);
        const iw_time_us_t span_us =
            first ? (iw_time_us_t)self->config->zero_hold_ms * IW_US_PER_MS : IW_PERMIT_HOLD_MAX_US;
        next_us = self->hold_us + span_us;
    }
    return next_us;
}
