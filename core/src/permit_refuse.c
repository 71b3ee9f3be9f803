// SPDX-License-Identifier: MIT
#include "permit_refuse.h"

#include "arithmetic.h"
#include "cause.h"

bool iw_refuse_may_send(const iw_config_t *config) {
    return !config->listen_only && config->setpoint_type_set && config->current_role != IW_ROLE_UNSET;
}

bool iw_refuse_not_followed(iw_cause_t cause) {
    return cause == IW_CAUSE_WHEEL_BLOCKED || cause == IW_CAUSE_PAIR_DIVERGES;
}

static iw_refusal_t refuse_present(const iw_permit_t *self, iw_time_us_t now_us) {
    return iw_cause_refusal(iw_permit_present(self, now_us));
}

/// The button comes first: no reset helps while it is pressed, and it is the only cause that the user can see.
static iw_refusal_t refuse_latched(iw_refusal_t present) {
    return (present == IW_REFUSE_ESTOP_PRESSED) ? present : IW_REFUSE_LATCHED;
}

/// R3: a deflected joystick at arm or reset must not set the machine in motion.
static bool stale_command(const iw_permit_t *self, iw_time_us_t now_us) {
    return iw_age_us(self->stale_us, now_us) < IW_STALE_COMMAND_US;
}

/// Reasons against any sending. Configuration and latch come first, because the other reasons may end on their own.
static iw_refusal_t refuse_sending(const iw_permit_t *self, iw_time_us_t now_us) {
    const iw_refusal_t present = refuse_present(self, now_us);
    if (self->config->listen_only) {
        return IW_REFUSE_LISTEN_ONLY;
    }
    if (iw_refuse_latched(self)) {
        return refuse_latched(present);
    }
    if (!iw_refuse_may_send(self->config)) {
        return IW_REFUSE_TYPE_NOT_SET;
    }
    if (self->config->track_mm == 0U) {
        return IW_REFUSE_TRACK_NOT_SET;
    }
    if (present != IW_REFUSE_NONE) {
        return present;
    }
    if (!self->view.timing_ok) {
        return IW_REFUSE_TIMING_MISMATCH;
    }
    if (!self->view.online) {
        return IW_REFUSE_WHEEL_LOST;
    }
    return (self->phase == IW_PHASE_RESTARTING) ? IW_REFUSE_CAUSE_PRESENT : IW_REFUSE_NONE;
}

/// Returns the refusal of the client whose wheels did not follow.
static iw_refusal_t refuse_blocked(const iw_permit_t *self) {
    return (self->stop.cause == IW_CAUSE_PAIR_DIVERGES) ? IW_REFUSE_PAIR_DIVERGES : IW_REFUSE_WHEEL_BLOCKED;
}

/// Returns true for the client whose wheels did not follow, until the zeros of that stop have had their time. Until
/// BRAKING becomes HOLDING the output is not zero, which refuses arm.
static bool must_wait(const iw_permit_t *self, iw_time_us_t now_us, iw_client_t client) {
    return self->blocked == client && self->phase == IW_PHASE_HOLDING &&
           iw_age_us(self->hold_us, now_us) < self->config->zero_hold_ms * IW_US_PER_MS;
}

static iw_refusal_t refuse_lease(const iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover) {
    if (self->holder != IW_CLIENT_NONE && (!takeover || iw_permit_arming(self))) {
        return IW_REFUSE_BUSY;
    }
    if (must_wait(self, now_us, client)) {
        return refuse_blocked(self);
    }
    if (stale_command(self, now_us)) {
        return IW_REFUSE_STALE_COMMAND;
    }
    if (!self->view.at_rest || !self->view.output_zero) {
        return IW_REFUSE_NOT_AT_REST;
    }
    // In LISTENING a frame that is still in the controller is an old one. A pair after it would send it first.
    if (self->phase == IW_PHASE_LISTENING && !self->view.can_send) {
        return IW_REFUSE_SEND_STALLED;
    }
    return IW_REFUSE_NONE;
}

iw_refusal_t iw_refuse_arm(const iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover) {
    const iw_refusal_t sending = refuse_sending(self, now_us);
    return (sending != IW_REFUSE_NONE) ? sending : refuse_lease(self, now_us, client, takeover);
}

/// In ARMED only the holder drives, and only while the lease lasts, even if no step has ended it yet.
static iw_refusal_t refuse_holder(const iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client) {
    if (self->holder != client) {
        return IW_REFUSE_NOT_HOLDER;
    }
    // The command waited in a queue since before arm, so it is not fresh (R3).
    if (sent_us < self->armed_us) {
        return IW_REFUSE_STALE_COMMAND;
    }
    return (sent_us < self->lease_until_us) ? IW_REFUSE_NONE : IW_REFUSE_NOT_ARMED;
}

iw_refusal_t iw_refuse_drive(const iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client) {
    switch (iw_permit_state(self)) {
    case IW_STATE_LATCHED:
        return refuse_latched(refuse_present(self, sent_us));
    case IW_STATE_STOPPING:
        return (self->blocked == client) ? refuse_blocked(self) : IW_REFUSE_NOT_ARMED;
    case IW_STATE_ARMED:
        return refuse_holder(self, sent_us, client);
    case IW_STATE_LISTENING:
    default:
        return self->config->listen_only ? IW_REFUSE_LISTEN_ONLY : IW_REFUSE_NOT_ARMED;
    }
}

iw_refusal_t iw_refuse_reset(const iw_permit_t *self, iw_time_us_t now_us) {
    const iw_refusal_t present = refuse_present(self, now_us);
    if (present != IW_REFUSE_NONE) {
        return present;
    }
    if (!self->view.online) {
        return IW_REFUSE_WHEEL_LOST;
    }
    // In LATCHED the ramp with one wheel offline continues, and it may end below `rest_rpm`.
    if (!self->view.at_rest || !self->view.output_zero) {
        return IW_REFUSE_NOT_AT_REST;
    }
    return stale_command(self, now_us) ? IW_REFUSE_STALE_COMMAND : IW_REFUSE_NONE;
}
