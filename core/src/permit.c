// SPDX-License-Identifier: MIT
#include "iwheel/private/permit.h"

#include "arithmetic.h"
#include "cause.h"
#include "permit_refuse.h"

#include <string.h>

/// State that clients see in a phase, and its demand on the scheduler.
typedef struct {
    uint8_t state;   ///< An iw_state_t.
    uint8_t demand;  ///< An iw_demand_t.
    uint8_t at_once; ///< The demand if zero without a ramp is required.
} phase_row_t;

static const phase_row_t phases[IW_PHASES] = {
    [IW_PHASE_LISTENING] = {IW_STATE_LISTENING, IW_DEMAND_SILENCE, IW_DEMAND_SILENCE},
    [IW_PHASE_ARMING] = {IW_STATE_LISTENING, IW_DEMAND_ZERO, IW_DEMAND_ZERO},
    [IW_PHASE_ARMED] = {IW_STATE_ARMED, IW_DEMAND_FOLLOW, IW_DEMAND_FOLLOW},
    [IW_PHASE_BRAKING] = {IW_STATE_STOPPING, IW_DEMAND_BRAKE, IW_DEMAND_ZERO},
    [IW_PHASE_HOLDING] = {IW_STATE_STOPPING, IW_DEMAND_BRAKE, IW_DEMAND_ZERO},
    [IW_PHASE_REARMING] = {IW_STATE_STOPPING, IW_DEMAND_BRAKE, IW_DEMAND_ZERO},
    [IW_PHASE_RESTARTING] = {IW_STATE_STOPPING, IW_DEMAND_ZERO, IW_DEMAND_ZERO},
    [IW_PHASE_CUT] = {IW_STATE_LATCHED, IW_DEMAND_BRAKE, IW_DEMAND_ZERO},
    [IW_PHASE_LATCHED] = {IW_STATE_LATCHED, IW_DEMAND_SILENCE, IW_DEMAND_SILENCE},
};

IW_STATIC_ASSERT(IW_NEVER == UINT64_MAX, never_is_all_ones_to_permit);

#define US_PER_S 1000000U

/// Setpoints without echo that a dying process can leave in its controller: two per wheel (R6).
#define LEFT_BEHIND_MAX 4U

iw_state_t iw_permit_state(const iw_permit_t *self) {
    return (iw_state_t)phases[self->phase].state;
}

iw_demand_t iw_permit_demand(const iw_permit_t *self) {
    const phase_row_t *const row = &phases[self->phase];
    return (iw_demand_t)(self->at_once ? row->at_once : row->demand);
}

void iw_permit_init(iw_permit_t *self, const iw_config_t *config, iw_time_us_t now_us, bool restarted) {
    memset(self, 0, sizeof *self);
    self->config = config;
    self->stale_us = IW_NEVER;
    self->diverged_us[0] = IW_NEVER;
    self->diverged_us[1] = IW_NEVER;
    memset(self->seen_us, 0xFF, sizeof self->seen_us); // IW_NEVER
    self->latch_until_release = config->hold;
    // Fault 25: after a crash in ARMED the wheels hold the last command until their own watchdog ends it.
    if (restarted && iw_refuse_may_send(config)) {
        self->phase = IW_PHASE_RESTARTING;
        self->hold_us = now_us;
        self->until_release = self->latch_until_release;
        self->stop.cause = IW_CAUSE_RESTART;
        self->stop.first = IW_CAUSE_RESTART;
        self->stop.at_once = true;
        self->stop.at_us = now_us;
        self->stop.number = 1;
    }
}

static void grant_lease(iw_permit_t *self, iw_time_us_t now_us, uint32_t span_us) {
    self->lease_from_us = now_us;
    self->lease_until_us = now_us + span_us;
}

/// Makes `client` the lease holder: ARMED begins, or the lease moves from another client.
static IW_APART void begin_driving(iw_permit_t *self, iw_time_us_t now_us) {
    self->armed_us = now_us;
    grant_lease(self, now_us, IW_FIRST_LEASE_US);
}

/// Returns the time since the last renewal of the lease.
static uint32_t unfed_ms(const iw_permit_t *self, iw_time_us_t now_us) {
    return iw_age_us(self->lease_from_us, now_us) / IW_US_PER_MS;
}

uint32_t iw_permit_present(const iw_permit_t *self, iw_time_us_t now_us) {
    return iw_cause_present(self->present | self->raised, self->seen_us, now_us);
}

/// Ends a failed arming: returns to the phase before it. `hold_us` distinguishes BRAKING from HOLDING.
static void end_arming(iw_permit_t *self, iw_refusal_t refusal) {
    const iw_phase_t zeros = (self->hold_us == IW_NEVER) ? IW_PHASE_BRAKING : IW_PHASE_HOLDING;
    if (iw_permit_arming(self)) {
        self->phase = (self->phase == IW_PHASE_ARMING) ? IW_PHASE_LISTENING : zeros;
        self->arm_refusal = refusal;
        self->holder = IW_CLIENT_NONE;
    }
}

/// Returns true for a stop without a ramp, as the event or else its cause requires.
static bool is_at_once(const iw_event_t *event) {
    return (event->react == IW_REACT_BY_CAUSE) ? iw_cause_rows[event->cause].at_once : event->react == IW_REACT_ZERO;
}

/// Records the stop. It runs before the phase changes, so that `from`, holder and applied speeds are those of the
/// moment.
static IW_APART void record_stop(iw_permit_t *self, const iw_event_t *event, iw_time_us_t now_us) {
    iw_stop_t *const stop = &self->stop;
    stop->at_us = now_us;
    stop->number++;
    stop->detail = event->detail;
    stop->client = self->holder;
    stop->applied = self->view.applied;
    stop->cause = event->cause;
    stop->from = iw_permit_state(self);
    stop->sides = event->sides;
    stop->latched = iw_refuse_latched(self);
    if (!stop->latched) {
        stop->first = event->cause;
        stop->first_sides = event->sides;
        stop->first_detail = event->detail;
    }
    stop->at_once = is_at_once(event);
}

/// Stops by a ramp, because a hard stop topples a person who leans on the machine. `at_once` if waiting is the greater
/// risk.
static IW_APART void brake(iw_permit_t *self, const iw_event_t *event, iw_time_us_t now_us) {
    record_stop(self, event, now_us);
    self->blocked = iw_refuse_not_followed(event->cause) ? self->holder : IW_CLIENT_NONE;
    self->phase = IW_PHASE_BRAKING;
    self->at_once = is_at_once(event);
    self->hold_us = IW_NEVER;
    self->holder = IW_CLIENT_NONE;
}

/// Records a stop that has only a cause and a time.
static void brake_after(iw_permit_t *self, iw_cause_t cause, iw_time_us_t now_us, uint32_t detail) {
    const iw_event_t event = {cause, IW_SIDES_NONE, detail, IW_REACT_BY_CAUSE};
    brake(self, &event, now_us);
}

/// From LISTENING no zeros are sent: the core does not move the wheels, and another master may drive them.
static void latch(iw_permit_t *self, const iw_event_t *event, iw_time_us_t now_us) {
    record_stop(self, event, now_us);
    self->stop.latched = true;
    const bool was_listening = self->phase == IW_PHASE_LISTENING;
    end_arming(self, (iw_refusal_t)iw_cause_rows[event->cause].refusal);
    self->phase = was_listening ? IW_PHASE_LATCHED : IW_PHASE_CUT;
    // The client that released the hold before did not know of this latch.
    self->until_release = self->latch_until_release;
    self->at_once = is_at_once(event);
    self->hold_us = now_us;
    self->holder = IW_CLIENT_NONE;
    self->blocked = IW_CLIENT_NONE;
}

/// ARMING and RESTARTING send only zeros, so a fault there refuses arm and needs no latch.
static bool latches(const iw_permit_t *self, iw_cause_t cause) {
    switch (self->phase) {
    case IW_PHASE_LISTENING:
    case IW_PHASE_ARMING:
    case IW_PHASE_RESTARTING:
        return iw_cause_rows[cause].effect == IW_ALWAYS_LATCHES;
    default:
        return iw_cause_rows[cause].effect != IW_STOPS;
    }
}

/// Counts a setpoint of another sender in RESTARTING. The first ones may be those of the dead process in its
/// controller. More of them show a second master that drives, and the hold ends (fault 25).
static void count_stranger(iw_permit_t *self) {
    self->strangers++;
    if (self->strangers > LEFT_BEHIND_MAX) {
        self->phase = IW_PHASE_LISTENING;
    }
}

/// Handles a cause that neither latches nor stops a holder: it ends arming.
static void tolerate(iw_permit_t *self, iw_cause_t cause) {
    end_arming(self, (iw_refusal_t)iw_cause_rows[cause].refusal);
}

/// A pair that diverges repeatedly has a fault that another arm does not end, so the third time latches.
static bool diverges_again(iw_permit_t *self, iw_time_us_t now_us) {
    const bool again = iw_age_us(self->diverged_us[1], now_us) < IW_PERMIT_DIVERGED_US;
    self->diverged_us[1] = self->diverged_us[0];
    self->diverged_us[0] = now_us;
    return again;
}

/// Handles a cause in ARMED: the wheels stop.
static void stop_holder(iw_permit_t *self, const iw_event_t *event, iw_time_us_t now_us) {
    if (event->cause == IW_CAUSE_PAIR_DIVERGES && diverges_again(self, now_us)) {
        latch(self, event, now_us);
    } else {
        brake(self, event, now_us);
    }
}

/// A latch retains its first cause, because later ones are mostly consequences of it. Only an e-stop is a stop of its
/// own, or a person who knows only the earlier stop could reset it. It changes neither the zeros nor their time.
void iw_permit_raise(iw_permit_t *self, const iw_event_t *event, iw_time_us_t now_us) {
    const iw_cause_t cause = event->cause;
    if (iw_refuse_latched(self) && iw_cause_is_new_estop(cause, self->seen_us, now_us)) {
        record_stop(self, event, now_us);
    }
    self->raised |= IW_CAUSE_BIT(cause);
    self->seen_us[cause] = now_us;
    self->quiet = false;
    // A cause without a ramp ends a ramp that is active.
    self->at_once = self->at_once || is_at_once(event);
    if (iw_refuse_latched(self)) {
        return;
    }
    if (latches(self, cause)) {
        latch(self, event, now_us);
    } else if (self->phase == IW_PHASE_ARMED) {
        stop_holder(self, event, now_us);
    } else if (self->phase == IW_PHASE_RESTARTING && cause == IW_CAUSE_SECOND_MASTER) {
        count_stranger(self);
    } else {
        tolerate(self, cause);
    }
}

void iw_permit_retain_present(iw_permit_t *self) {
    self->raised |= self->present & (IW_CAUSE_BIT(IW_CAUSE_SEND_STALLED) | IW_CAUSE_BIT(IW_CAUSE_WHEEL_LOST));
}

static void step_arming(iw_permit_t *self, iw_time_us_t now_us) {
    const uint32_t limit_us = self->config->echo_ms * IW_US_PER_MS;
    const uint32_t waited_us = iw_age_us(self->arming_us, now_us);
    // A late echo does not arm, even if no step has ended the wait yet.
    if (self->view.proven && waited_us <= limit_us) {
        self->phase = IW_PHASE_ARMED;
        begin_driving(self, now_us);
    } else if (waited_us >= limit_us) {
        end_arming(self, IW_REFUSE_SEND_STALLED);
    }
}

/// Returns true if the hold ends by time alone: the wheels are at standstill, or it cannot wait for that. After a
/// restart there may be no telemetry, and the wheel's own watchdog (1 s) is shorter than the hold.
static bool time_is_enough(const iw_permit_t *self) {
    return self->view.settled || self->phase == IW_PHASE_RESTARTING;
}

/// Returns true while the ramp of a latch with one wheel offline continues. The zeros are counted from its end.
static bool is_ramping(const iw_permit_t *self) {
    return self->phase == IW_PHASE_CUT && !self->at_once && !self->view.output_zero;
}

/// The core does not send zeros against a second master for longer than needed.
static IW_APART bool is_contested(const iw_permit_t *self) {
    const iw_time_us_t other_us = self->seen_us[IW_CAUSE_SECOND_MASTER];
    return other_us != IW_NEVER && other_us >= self->hold_us;
}

/// Returns the longest duration of the zeros.
static uint32_t longest_us(const iw_permit_t *self) {
    return is_contested(self) ? IW_PERMIT_CONTESTED_US : self->config->hold_max_s * US_PER_S;
}

/// Returns true in phases that send zeros until a time or an event.
static bool is_holding(iw_phase_t phase) {
    return phase >= IW_PHASE_HOLDING && phase <= IW_PHASE_CUT;
}

/// R19: a machine on a slope must not roll because time has passed.
bool iw_permit_holding(const iw_permit_t *self) {
    return self->until_release && (self->phase == IW_PHASE_HOLDING || self->phase == IW_PHASE_CUT) &&
           !is_contested(self);
}

/// Returns the phase after the zeros.
static iw_phase_t after_hold(const iw_permit_t *self) {
    if (self->phase == IW_PHASE_CUT) {
        return IW_PHASE_LATCHED;
    }
    return (self->phase == IW_PHASE_RESTARTING && self->until_release) ? IW_PHASE_HOLDING : IW_PHASE_LISTENING;
}

/// Sends zeros for `zero_hold_ms` and until the wheels are at standstill, but at most `hold_max_s`. Otherwise a wheel
/// that is pushed or faulty would receive zeros without end.
static void step_hold(iw_permit_t *self, iw_time_us_t now_us) {
    if (is_ramping(self)) {
        self->hold_us = now_us;
    }
    if (iw_permit_holding(self)) {
        // After a release, the zeros for a turning wheel have their full time.
        if (!time_is_enough(self)) {
            self->hold_us = now_us;
        }
        return;
    }
    const uint32_t held_us = iw_age_us(self->hold_us, now_us);
    // The end of zeros for a moving wheel is an event that the operator must see.
    const bool is_overdue = held_us >= longest_us(self) && !self->view.settled;
    if (is_overdue) {
        self->still_moving++;
    }
    if (is_overdue || (held_us >= self->config->zero_hold_ms * IW_US_PER_MS && time_is_enough(self))) {
        self->phase = after_hold(self);
        // Setpoints that the dead process left in its controller do not count as a second master in the next hold.
        self->hold_us = now_us;
    }
}

bool iw_permit_ending(const iw_permit_t *self, iw_time_us_t now_us) {
    return is_holding(self->phase) && !iw_permit_holding(self) && !time_is_enough(self) &&
           iw_age_us(self->hold_us, now_us) >= longest_us(self) - IW_PERMIT_ENDING_US;
}

static void step_phase(iw_permit_t *self, iw_time_us_t now_us) {
    const iw_phase_t phase = self->phase;
    if (phase == IW_PHASE_ARMED) {
        if (now_us >= self->lease_until_us) {
            brake_after(self, IW_CAUSE_LEASE_LOST, now_us, unfed_ms(self, now_us));
        }
    } else if (phase == IW_PHASE_BRAKING) {
        if (self->at_once || self->view.output_zero) {
            self->phase = IW_PHASE_HOLDING;
            self->hold_us = now_us;
        }
    } else if (is_holding(phase)) {
        step_hold(self, now_us);
    }
}

void iw_permit_step(iw_permit_t *self, iw_time_us_t now_us) {
    self->present = self->raised;
    self->raised = 0;
    self->quiet = self->quiet || iw_permit_present(self, now_us) == 0U;
    if (iw_permit_arming(self)) {
        step_arming(self, now_us);
    }
    step_phase(self, now_us);
}

static void begin_arming(iw_permit_t *self, iw_time_us_t now_us) {
    self->phase = (self->phase == IW_PHASE_LISTENING) ? IW_PHASE_ARMING : IW_PHASE_REARMING;
    self->arming_us = now_us;
    self->arm_refusal = IW_REFUSE_NONE;
    self->latch_until_release = self->config->hold;
    self->until_release = self->latch_until_release;
}

iw_refusal_t iw_permit_arm(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover) {
    if (self->holder == client) {
        // Arm does not extend the lease; only drive commands do.
        return IW_REFUSE_NONE;
    }
    const iw_refusal_t refusal = iw_refuse_arm(self, now_us, client, takeover);
    if (refusal != IW_REFUSE_NONE) {
        return refusal;
    }
    self->holder = client;
    if (self->phase == IW_PHASE_ARMED) {
        begin_driving(self, now_us);
    } else {
        begin_arming(self, now_us);
    }
    return IW_REFUSE_NONE;
}

/// Commands of several clients may arrive in another order than they were sent: the latest one counts.
void iw_permit_note_command(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client) {
    if (self->stale_us == IW_NEVER || now_us >= self->stale_us) {
        self->stale_us = now_us;
        self->stale_client = client;
    }
}

iw_refusal_t iw_permit_drive(iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client, bool nonzero) {
    // A refused command counts too: it shows that a client wants motion.
    if (nonzero) {
        iw_permit_note_command(self, sent_us, client);
    }
    const iw_refusal_t refusal = iw_refuse_drive(self, sent_us, client);
    if (refusal == IW_REFUSE_NONE) {
        grant_lease(self, sent_us, self->config->lease_ms * IW_US_PER_MS);
    }
    return refusal;
}

/// Ends the lease and the arming of a client.
static IW_APART void end_holder(iw_permit_t *self, iw_cause_t cause, iw_time_us_t now_us) {
    if (self->phase == IW_PHASE_ARMED) {
        brake_after(self, cause, now_us, 0);
    }
    end_arming(self, IW_REFUSE_NOT_ARMED);
}

void iw_permit_stop(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, iw_cause_t cause) {
    const bool armed = self->phase == IW_PHASE_ARMED;
    end_holder(self, cause, now_us);
    if (armed) {
        self->stop.client = client;
    }
    if (cause == IW_CAUSE_SHUTDOWN) {
        self->latch_until_release = false;
        self->until_release = false;
    }
}

void iw_permit_disconnect(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client) {
    if (client == self->holder) {
        end_holder(self, IW_CAUSE_CLIENT_GONE, now_us);
    }
}

iw_refusal_t iw_permit_reset(iw_permit_t *self, iw_time_us_t now_us) {
    if (!iw_refuse_latched(self)) {
        return IW_REFUSE_NONE;
    }
    const iw_refusal_t refusal = iw_refuse_reset(self, now_us);
    if (refusal == IW_REFUSE_NONE) {
        self->phase = iw_permit_holding(self) ? IW_PHASE_HOLDING : IW_PHASE_LISTENING;
    }
    return refusal;
}

iw_refusal_t iw_permit_release(iw_permit_t *self) {
    if ((!is_holding(self->phase) || is_ramping(self)) && iw_permit_demand(self) != IW_DEMAND_SILENCE) {
        return IW_REFUSE_NOT_AT_REST;
    }
    self->until_release = false;
    return IW_REFUSE_NONE;
}

iw_time_us_t iw_permit_next_us(const iw_permit_t *self) {
    const iw_config_t *const config = self->config;
    if (iw_permit_arming(self)) {
        const uint32_t echo_us = config->echo_ms * IW_US_PER_MS;
        return self->arming_us + echo_us;
    }
    if (self->phase == IW_PHASE_ARMED) {
        return self->lease_until_us;
    }
    if (is_holding(self->phase) && !iw_permit_holding(self)) {
        return self->hold_us + (time_is_enough(self) ? config->zero_hold_ms * IW_US_PER_MS : longest_us(self));
    }
    return IW_NEVER;
}
