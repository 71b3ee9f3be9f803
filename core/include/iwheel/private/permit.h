// SPDX-License-Identifier: MIT
/// @file
/// Motion permission: decides whether the wheels may move, and stores the reason why not.
///
///     LISTENING --arm--> ARMING --TX confirmed--> ARMED --lease lost | stop | disarm | cause--> BRAKING
///         ^ ^              | failed                 ^                                           | output zero
///         | |              v                        | TX confirmed                            v
///         | +----------- LISTENING               REARMING <--------------- arm ----------- HOLDING --held--> LISTENING
///         |                                         | failed                                 ^
///         |                                         +----------------------------------------+
///         |   RESTARTING --held, or another master drives--> LISTENING
///         |
///         |   any of them --latching cause--> CUT --held--> LATCHED;  from LISTENING directly: LATCHED
///         +------------------------------- reset ------------- CUT, LATCHED
///
/// Arming fails if TX is not confirmed in time, and by any stop, disarm or cause. If arm follows a stop before a step
/// has changed BRAKING to HOLDING, a failed REARMING returns to BRAKING.
///
/// Clients see four states: LISTENING (with ARMING), ARMED, STOPPING (BRAKING, HOLDING, REARMING, RESTARTING) and
/// LATCHED (with CUT). The core sends nothing in LISTENING and LATCHED. ARMING sends one zero pair, and ARMED begins
/// when the pair is confirmed. REARMING is ARMING while zeros are sent for a stop. A table maps each state to a demand
/// on the scheduler.
///
/// Pure state machine: no I/O, no clock. In every step the owner first raises the faults that it has detected
/// (`iw_permit_raise`), then calls `iw_permit_step`, then passes `iw_permit_demand` to the scheduler.
///
/// A table defines the effect of each cause. Some causes latch in every state. Some latch while setpoints are sent;
/// otherwise they only refuse arm and reset while they are present. Some only stop. RESTARTING sends zeros on behalf of
/// a process that died. There only causes that latch in every state latch.
///
/// With `iw_config_t::hold` (R19) time ends neither HOLDING nor CUT, RESTARTING becomes HOLDING, and `reset` leads from
/// CUT to HOLDING. The hold ends by a setpoint of another sender, by `iw_permit_release`, and by the end of the
/// gateway. Then time ends the zeros, as without the option. A latch after a release, while zeros are still sent, holds
/// again.
///
/// Only an accepted drive command extends the lease.
#ifndef IW_PERMIT_H
#define IW_PERMIT_H

#include "iwheel/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A cause that is an event counts as gone after this time without a new one.
#define IW_PERMIT_EVENT_US 1000000U
/// The core sends zeros until both wheels were at standstill for this time ...
#define IW_PERMIT_SETTLED_US 500000U
/// ... but at most for `hold_max_s`, and against a second master at most for this time.
#define IW_PERMIT_CONTESTED_US 10000000U
/// If a wheel still moves, the end of the zeros is reported this long before it.
#define IW_PERMIT_ENDING_US 5000000U

/// States of the diagram above. The order matters: states in which time ends the zeros are adjacent, and the latched
/// states come last.
typedef enum {
    IW_PHASE_LISTENING = 0, ///< Nothing is sent.
    IW_PHASE_ARMING,        ///< A zero pair waits for its TX confirmation.
    IW_PHASE_REARMING,      ///< Like ARMING, while zeros are sent for a stop.
    IW_PHASE_ARMED,         ///< The holder drives.
    IW_PHASE_BRAKING,       ///< Ramp to zero, or zero immediately.
    IW_PHASE_HOLDING,       ///< Zeros until the wheels are at standstill.
    IW_PHASE_RESTARTING,    ///< Zeros on behalf of a process that died.
    IW_PHASE_CUT,           ///< Latched, with zeros: immediately, or by a ramp if one wheel is offline.
    IW_PHASE_LATCHED,       ///< Latched, nothing is sent.
    IW_PHASES,
} iw_phase_t;

/// The third IW_CAUSE_PAIR_DIVERGES within this time latches.
#define IW_PERMIT_DIVERGED_US 60000000U

/// Facts that the owner has found in this step.
typedef struct {
    bool online;       ///< Both wheels are online.
    bool at_rest;      ///< Both wheels were at standstill for rest_ms.
    bool settled;      ///< Both wheels were at standstill for IW_PERMIT_SETTLED_US.
    bool output_zero;  ///< The last pair was zero, or none was sent since the last pause.
    bool timing_ok;    ///< The bus timing is not contradicted.
    bool can_send;     ///< The sender could send a zero to both wheels now.
    bool proven;       ///< Both frames of the arming pair have been echoed.
    iw_pair_t applied; ///< Last pair, in the machine's frame.
} iw_permit_view_t;

/// State of the permission. Short members come first, because a Cortex-M addresses them with shorter instructions.
typedef struct {
    const iw_config_t *config;   ///< Configuration of the owner.
    iw_phase_t phase;            ///< State of the diagram.
    iw_refusal_t arm_refusal;    ///< Reason why the last arming failed.
    uint8_t strangers;           ///< Number of setpoints of other senders in RESTARTING.
    bool quiet;                  ///< No latching cause is present or recent, so a step need not search for one.
    bool at_once;                ///< In BRAKING, CUT and the states after them: zero without ramp.
    bool until_release;          ///< Only a release ends the next zeros; time does not.
    bool latch_until_release;    ///< Value of `until_release` after the next latch. False while the gateway ends.
    iw_permit_view_t view;       ///< Facts of the last step, written by the owner. Requests are judged by them.
    iw_client_t stale_client;    ///< Client of the last nonzero drive command.
    iw_client_t holder;          ///< Lease holder; IW_CLIENT_NONE if there is none.
    iw_client_t blocked;         ///< Client whose wheels did not follow at the last stop: see iw_permit_arm.
    uint32_t raised;             ///< Bit mask of causes that were raised since the last step.
    uint32_t present;            ///< Bit mask of causes that were raised in the step before.
    uint32_t still_moving;       ///< Number of holds that ended after `hold_max_s` while a wheel still turned.
    iw_time_us_t armed_us;       ///< Time at which ARMED began or the lease moved: older commands are stale.
    iw_time_us_t lease_from_us;  ///< Time of the last accepted drive command, or of arm.
    iw_time_us_t lease_until_us; ///< End of the lease, unless another drive command arrives.
    iw_time_us_t arming_us;      ///< Time at which ARMING or REARMING began.
    iw_time_us_t hold_us;        ///< Time at which the zeros began; IW_NEVER if there were none since the last stop.
    iw_time_us_t stale_us;       ///< Last well-formed nonzero drive command of any client; IW_NEVER if none.
    iw_time_us_t diverged_us[2]; ///< Times of the last two IW_CAUSE_PAIR_DIVERGES, newest first; IW_NEVER if none.
    iw_stop_t stop;              ///< Record of the last stop. No decision depends on it.
    iw_time_us_t seen_us[IW_CAUSES]; ///< Last time of each cause; IW_NEVER if it never occurred.
} iw_permit_t;

/// Reaction to a cause.
typedef enum {
    IW_REACT_BY_CAUSE = 0, ///< The usual reaction of the cause.
    IW_REACT_RAMP,         ///< Common ramp.
    IW_REACT_ZERO,         ///< Zero immediately.
} iw_react_t;

/// A cause of a stop with its details.
typedef struct {
    iw_cause_t cause; ///< Cause that is present or has just occurred.
    uint8_t sides;    ///< Wheels that the cause refers to: IW_SIDES_...
    uint32_t detail;  ///< See iw_cause_t.
    uint8_t react;    ///< An iw_react_t.
} iw_event_t;

/// Initializes `self`. `config` must be checked, and must exist as long as `self`. `restarted`: begin with zeros
/// (STOPPING, cause RESTART), because the previous process died while armed. These zeros end if another master sends
/// setpoints. Two setpoints per wheel do not count, because the dead process may have left them in its controller.
void iw_permit_init(iw_permit_t *self, const iw_config_t *config, iw_time_us_t now_us, bool restarted);

/// Reports that a cause is present or has just occurred. It takes effect immediately. In a latch only an e-stop that
/// begins is a new stop. Repeated within IW_PERMIT_EVENT_US it is the same.
void iw_permit_raise(iw_permit_t *self, const iw_event_t *event, iw_time_us_t now_us);

/// Reports that this step cannot judge ages: SEND_STALLED and WHEEL_LOST remain present if they were present.
void iw_permit_retain_present(iw_permit_t *self);

/// Applies the effects of time and of `view`: end of the lease, of arming and of the hold. The owner writes `view`
/// before the call.
void iw_permit_step(iw_permit_t *self, iw_time_us_t now_us);

/// Returns the state that clients see.
iw_state_t iw_permit_state(const iw_permit_t *self);

/// Returns true while an accepted arm request waits for its TX confirmation.
static inline bool iw_permit_arming(const iw_permit_t *self) {
    return self->phase == IW_PHASE_ARMING || self->phase == IW_PHASE_REARMING;
}

/// Returns true if the cause latches in every state, or while setpoints are sent.
bool iw_cause_latches(iw_cause_t cause);

/// Returns the present demand on the scheduler.
iw_demand_t iw_permit_demand(const iw_permit_t *self);

/// Requests ARMED for `client`. Returns IW_REFUSE_NONE if arming has begun, or if the client already holds the lease,
/// which does not extend it. The client whose wheels did not follow waits until the zeros of that stop have lasted
/// `zero_hold_ms`. With `takeover` the lease of another client moves to `client` if the output is zero and both wheels
/// are at standstill.
iw_refusal_t iw_permit_arm(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover);

/// Judges a well-formed drive command. Returns IW_REFUSE_NONE if it is accepted, and extends the lease. Stores the time
/// of a nonzero command, accepted or not. `sent_us`: time at which the client sent the command, not later than now. The
/// lease starts at that time, and a command from before ARMED is refused as IW_REFUSE_STALE_COMMAND. A command that is
/// older than the last accepted one is accepted and shortens the lease, so the owner passes commands in order.
iw_refusal_t iw_permit_drive(iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client, bool nonzero);

/// Stores the time of a nonzero drive command that was refused as out of range. It refuses arm and reset like any
/// other.
void iw_permit_note_command(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client);

/// Stops without a latch, and ends arming. Any client may request it. `cause`: IW_CAUSE_CLIENT_STOP or
/// IW_CAUSE_SHUTDOWN; SHUTDOWN also releases a hold.
void iw_permit_stop(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, iw_cause_t cause);

/// Reports that the connection of `client` has ended.
void iw_permit_disconnect(iw_permit_t *self, iw_time_us_t now_us, iw_client_t client);

/// Leaves LATCHED, or returns the reason why it must not. If the state is not latched, it changes nothing and returns
/// IW_REFUSE_NONE.
iw_refusal_t iw_permit_reset(iw_permit_t *self, iw_time_us_t now_us);

/// Releases a hold: time then ends the zeros. Refused as IW_REFUSE_NOT_AT_REST while the wheels are driven, ramp down,
/// or wait to be armed. Without a hold it changes nothing and returns IW_REFUSE_NONE.
iw_refusal_t iw_permit_release(iw_permit_t *self);

/// Returns true while zeros are sent that time does not end.
bool iw_permit_holding(const iw_permit_t *self);

/// Returns the bit mask of latching causes that refuse a reset now: those that are present, and events that are not
/// older than IW_PERMIT_EVENT_US.
uint32_t iw_permit_present(const iw_permit_t *self, iw_time_us_t now_us);

/// Returns true if a wheel still moves or is offline, and the zeros end within IW_PERMIT_ENDING_US.
bool iw_permit_ending(const iw_permit_t *self, iw_time_us_t now_us);

/// Returns the time at which `iw_permit_step` must run even if nothing happens; IW_NEVER if there is none.
iw_time_us_t iw_permit_next_us(const iw_permit_t *self);

#ifdef __cplusplus
}
#endif
#endif
