// SPDX-License-Identifier: MIT
/// @file
/// May the wheels move, and if not, why?
///
///     LISTENING --arm--> ARMING --TX confirmed--> ARMED --lease lost | stop | disarm | cause--> BRAKING
///         ^ ^              | failed                 ^                                           | output zero
///         | |              v                        | TX confirmed                            v
///         | +----------- LISTENING               REARMING <--------------- arm ----------- HOLDING --held--> LISTENING
///         |                                         | failed                                 ^
///         |                                         +----------------------------------------+
///         |   RESTARTING --held, or somebody else drives--> LISTENING
///         |
///         |   any of them --latching cause--> CUT --held--> LATCHED;  from LISTENING at once: LATCHED
///         +------------------------------- reset ------------- CUT, LATCHED
///
/// Arming has failed when TX is not confirmed in time, and by any stop, disarm or cause. A stop at zero output can be
/// followed by arm before a step has made HOLDING of BRAKING: then REARMING falls back to BRAKING.
///
/// A client sees four of them: LISTENING (and ARMING), ARMED, STOPPING (BRAKING, HOLDING, REARMING, RESTARTING) and
/// LATCHED (and CUT). Nothing is sent in LISTENING and LATCHED; ARMING sends one zero pair, and ARMED begins when it is
/// confirmed; REARMING is ARMING while zeros are held anyway. What each demands of the scheduler is a row of a table.
///
/// Pure state machine: no I/O, no clock. In every step the owner first raises the faults it sees (`iw_permit_raise`),
/// then calls `iw_permit_step`, then hands `iw_permit_demand` to the scheduler.
///
/// What a cause does is its row: some latch in every state; some latch while setpoints are sent and are otherwise only
/// remembered, to refuse arm and reset while present; some only stop. RESTARTING sends zeros for a process that died,
/// and nothing but those is ours yet: there only what latches in every state latches.
///
/// With `iw_config_t::hold` (R19) time ends neither HOLDING nor CUT; held RESTARTING becomes HOLDING, and `reset` leads
/// from CUT to HOLDING. Another sender's setpoint ends that, `iw_permit_release`, and the end of the gateway: from then
/// on time ends the zeros as without it. A latch after a release, while zeros are still sent, is held again.
///
/// The lease is fed by accepted drive commands and by nothing else.
#ifndef IW_PERMIT_H
#define IW_PERMIT_H

#include "iwheel/config.h"

/// A cause that is an event counts as gone when not seen for this long.
#define IW_PERMIT_EVENT_US 1000000U
/// Zeros are held until both wheels were at rest for this long ...
#define IW_PERMIT_SETTLED_US 500000U
/// ... but at most for `hold_max_s`, and no longer than this against a second master.
#define IW_PERMIT_CONTESTED_US 10000000U
/// So long before the end of zeros for a wheel that still moves that is reported.
#define IW_PERMIT_ENDING_US 5000000U

/// The states of the diagram above. Those in which time ends the zeros stand together; the latched ones come last.
typedef enum {
    IW_PHASE_LISTENING = 0, ///< Silent.
    IW_PHASE_ARMING,        ///< A zero pair waits for its TX confirmation.
    IW_PHASE_REARMING,      ///< As ARMING, while zeros are held.
    IW_PHASE_ARMED,         ///< The holder drives.
    IW_PHASE_BRAKING,       ///< Ramp to zero, or zero at once.
    IW_PHASE_HOLDING,       ///< Zeros are held until the wheels stand.
    IW_PHASE_RESTARTING,    ///< Zeros for a process that died.
    IW_PHASE_CUT,           ///< Latched; zeros, held. At once, but for one wheel offline.
    IW_PHASE_LATCHED,       ///< Latched; silent.
    IW_PHASES,
} iw_phase_t;

/// The third stop because the pair diverged within this time latches.
#define IW_PERMIT_DIVERGED_US 60000000U

/// What the owner knows at this step.
typedef struct {
    bool heard;        ///< Both wheels heard.
    bool at_rest;      ///< Both at rest for rest_ms.
    bool settled;      ///< Both at rest for IW_PERMIT_SETTLED_US.
    bool output_zero;  ///< The pair last sent was zero, or none was sent since the last silence.
    bool timing_ok;    ///< The bus timing is not contradicted.
    bool can_send;     ///< A zero could be handed over for both wheels now.
    bool proven;       ///< Both frames of the arming pair have been echoed.
    iw_pair_t applied; ///< What the wheels were last told, in the machine's frame.
} iw_permit_view_t;

/// Phase, lease, causes and the last stop. What is short stands first: a Cortex-M reaches it by shorter instructions.
typedef struct {
    const iw_config_t *config;  ///< The owner's.
    iw_phase_t phase;           ///< The state of the diagram.
    iw_refusal_t arm_refusal;   ///< Why the last arming failed.
    uint8_t strangers;          ///< Setpoints of other senders counted in RESTARTING.
    bool quiet;                 ///< No latching cause is there or happened lately: nothing to look for.
    bool at_once;               ///< BRAKING, CUT and what follows: zero without ramp.
    bool kept;                  ///< Time does not end the zeros that follow: not before release.
    bool keeps;                 ///< What `kept` becomes with the next latch: false once the gateway ends.
    iw_permit_view_t view;      ///< Of the last step, by the owner: requests are judged by it.
    iw_client_t stale_client;   ///< Who sent the last nonzero drive.
    iw_client_t holder;         ///< Of the lease; IW_CLIENT_NONE: nobody.
    iw_client_t blocked;        ///< Whose wheels did not follow when they stopped: refused as such until the hold ends.
    uint32_t raised;            ///< Bit per cause: raised since the last step.
    uint32_t present;           ///< Bit per cause: raised in the step before.
    uint32_t still_moving;      ///< Holds that ended by their longest time with a wheel not at rest.
    iw_time_us_t armed_us;      ///< When ARMED began or the lease was taken over: only later commands are fresh.
    iw_time_us_t lease_from_us; ///< The last accepted drive command, or arm.
    iw_time_us_t lease_until_us;     ///< Without another one the lease ends here.
    iw_time_us_t arming_us;          ///< When ARMING or REARMING began.
    iw_time_us_t hold_us;            ///< When the zeros that are held began; IW_NEVER: not since the last stop.
    iw_time_us_t stale_us;           ///< The last well-formed nonzero drive of anybody; IW_NEVER: none.
    iw_time_us_t diverged_us[2];     ///< When the pair diverged last, and before that; IW_NEVER: never.
    iw_stop_t stop;                  ///< A record: nothing is decided by it.
    iw_time_us_t seen_us[IW_CAUSES]; ///< When each cause was last seen; IW_NEVER: never.
} iw_permit_t;

/// Whether a stop ramps.
typedef enum {
    IW_REACT_BY_CAUSE = 0, ///< As its cause always does.
    IW_REACT_RAMP,         ///< Common ramp.
    IW_REACT_ZERO,         ///< Zero at once.
} iw_react_t;

/// A cause of a stop, and what is told of it.
typedef struct {
    iw_cause_t cause; ///< What is there, or has just happened.
    uint8_t sides;    ///< Which wheel it speaks of: IW_SIDES_...
    uint32_t detail;  ///< See iw_cause_t.
    uint8_t react;    ///< An iw_react_t.
} iw_event_t;

/// `config` must be checked and outlive it. `restarted`: begin with zeros (STOPPING, cause RESTART) because the
/// process before us died while armed. That hold gives way to another master, but not to what the dead process itself
/// may have left in its controller: two setpoints per wheel.
void iw_permit_init(iw_permit_t *self, const iw_config_t *config, iw_time_us_t now_us, bool restarted);

/// Tells that a cause is present or has just happened. It takes effect at once; the first cause of a latch stays the
/// cause.
void iw_permit_raise(iw_permit_t *self, const iw_event_t *event, iw_time_us_t now_us);

/// This step cannot judge what was received: SEND_STALLED and WHEEL_LOST stay present if they were.
void iw_permit_keep_present(iw_permit_t *self);

/// Everything that follows from time and from what the owner sees: end of lease, of arming and of the hold. The owner
/// has written into `view` what it sees.
void iw_permit_step(iw_permit_t *self, iw_time_us_t now_us);

/// What a client is told of the phase.
iw_state_t iw_permit_state(const iw_permit_t *self);

/// An arm that was granted waits for its TX confirmation.
static inline bool iw_permit_arming(const iw_permit_t *self) {
    return self->phase == IW_PHASE_ARMING || self->phase == IW_PHASE_REARMING;
}

/// True if this cause latches, at least while setpoints are sent.
bool iw_cause_latches(iw_cause_t cause);

/// What the scheduler must aim at now.
iw_demand_t iw_permit_demand(const iw_permit_t *self);

/// Asks to be armed. IW_REFUSE_NONE: arming has begun, or the client holds the lease already (which feeds nothing).
/// With `takeover` the lease of another client moves over, when outputs are zero and both wheels at rest.
iw_refusal_t iw_permit_arm(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover);

/// A well-formed drive command. IW_REFUSE_NONE: accepted, and the lease is fed. A nonzero one is remembered, accepted
/// or not. `sent_us` is when it was sent, as far as the owner can tell, not later than now: a command that waited in a
/// queue feeds the lease from then, and one from before ARMED began is refused as IW_REFUSE_STALE_COMMAND. One that was
/// sent before another that has been accepted is accepted too, and shortens the lease: an owner passes them on in
/// order.
iw_refusal_t iw_permit_drive(iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client, bool nonzero);

/// Somebody sent a nonzero drive command that was not even judged (out of range): it refuses arm and reset like any
/// other.
void iw_permit_remember(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client);

/// Somebody wants a stop without a latch: IW_CAUSE_CLIENT_STOP, IW_CAUSE_SHUTDOWN. Needs no lease. Ends arming.
/// SHUTDOWN releases too.
void iw_permit_stop(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, iw_cause_t cause);

/// A client's connection ended.
void iw_permit_disconnect(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client);

/// Leaves LATCHED for LISTENING if nothing speaks against it; not latched, it changes nothing and is not refused.
iw_refusal_t iw_permit_reset(iw_permit_t *self, iw_time_us_t now_us);

/// From now on time ends the zeros that are held. Refused as IW_REFUSE_NOT_AT_REST before they are: while the wheels
/// are driven, ramp down, or wait to be armed. Without a hold it changes nothing and is not refused.
iw_refusal_t iw_permit_release(iw_permit_t *self);

/// Zeros are held, and time does not end that.
bool iw_permit_holding(const iw_permit_t *self);

/// Bit per latching cause that keeps reset from succeeding now (present, or event-like and seen less than
/// IW_PERMIT_EVENT_US ago).
uint32_t iw_permit_present(const iw_permit_t *self, iw_time_us_t now_us);

/// A wheel still moves, or is not heard, and in IW_PERMIT_ENDING_US at the latest the zeros end all the same.
bool iw_permit_ending(const iw_permit_t *self, iw_time_us_t now_us);

/// When `iw_permit_step` has something to do although nothing happened; IW_NEVER if it has not.
iw_time_us_t iw_permit_next_us(const iw_permit_t *self);

#endif
