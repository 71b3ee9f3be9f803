// SPDX-License-Identifier: MIT
/// @file
/// A pair of wheels: everything of the core wired together.
///
///     bus -> receive -> decode -> wheel state -> permission -> scheduler -> encode -> envelope -> send -> bus
///
/// The owner calls `iw_gateway_step` when a frame, an e-stop edge or the time it returned is there, and as often as
/// it likes. Requests may come between steps, from the same thread of execution; a step right after one sends what
/// follows from it. What the wheels do is a pure function of configuration, times, frames and requests: the same
/// recording gives the same bytes on every port.
///
/// Size: docs/developer/sizes.md. No heap, no floating point, no file-scope state.
///
/// R1 to R19 in the core's comments are rules of docs/developer/safety-case.md, fault numbers are its catalogue's rows.
#ifndef IW_GATEWAY_H
#define IW_GATEWAY_H

#include "iwheel/codec.h"
#include "iwheel/config.h"
#include "iwheel/diverge.h"
#include "iwheel/force_offset.h"
#include "iwheel/hal.h"
#include "iwheel/private/assumption_store.h"
#include "iwheel/private/follow.h"
#include "iwheel/private/permit.h"
#include "iwheel/private/rolling.h"
#include "iwheel/private/setpoint.h"
#include "iwheel/private/transmit.h"
#include "iwheel/private/wheel.h"
#include "iwheel/snapshot.h"

/// In a step later than this the time of reception is unknown: its frames neither refresh nor fail a wheel's liveness.
#define IW_GATEWAY_LATE_US 20000U
/// Later than this, or in one late step after another for this long: STOPPING without ramp.
#define IW_GATEWAY_STOP_US 100000U
/// Later than this: LATCHED.
#define IW_GATEWAY_HUNG_US 500000U
/// While nothing is sent and a setpoint still lacks its TX confirmation, the port is asked to purge at once, then this
/// often.
#define IW_GATEWAY_LOST_ECHO_US 1000000U
/// Frames taken in one step at the most. A full bus brings 21 in a millisecond.
#define IW_GATEWAY_DRAIN_MAX 512U

/// What the port found out about the bus. All zero: nothing known, nothing contradicted.
typedef struct {
    bool timing_contradicted; ///< Rate or sample point differ from the configured ones: arm is refused.
    bool echo_proven;         ///< An echo proves that the frame was on the bus (IFF_ECHO; bxCAN).
} iw_bus_facts_t;

/// A drive request. Values are taken as they come: what does not fit is refused here.
typedef struct {
    int32_t speed_mm_s[IW_SIDES]; ///< In the machine's frame: positive is forward. -32768..32767.
    int32_t current_mA[IW_SIDES]; ///< +/- IW_CURRENT_LIMIT_mA; not negative with IW_ROLE_LIMIT.
    bool has_current;             ///< False: the configured maximum, allowed with IW_ROLE_LIMIT only.
} iw_drive_t;

/// What a drive request came to.
typedef struct {
    iw_pair_t pair; ///< The target after limits; ramps come on top.
    bool limited;   ///< It differs from the request: both wheels scaled by one factor, or a current limit raised.
} iw_applied_t;

/// The whole of it. Members are the core's own: what may be known of them, snapshot.h tells. What is short stands
/// first: a Cortex-M reaches it by shorter instructions.
typedef struct iw_gateway {
    iw_bus_state_t bus;   ///< As the port reported it in this step.
    iw_bus_facts_t facts; ///< As the port told them last.
    bool backlog;         ///< The last step left frames behind.
    bool stalled;         ///< This step does not know when its frames came: nothing is judged by age.
    /// Nothing is sent, but an unconfirmed setpoint is still in a controller: the port cannot purge it, or did not
    /// within IW_GATEWAY_LOST_ECHO_US. It may reach the bus when wheels get power.
    bool left_behind;
    uint32_t purged_stop;              ///< Number of the stop in whose zeros a purge was tried.
    iw_counters_t counters;            ///< Since init.
    iw_config_t config;                ///< Copied at init.
    iw_hal_t hal;                      ///< Copied at init.
    iw_time_us_t now_us;               ///< Of the present step.
    iw_time_us_t promised_us;          ///< When the last step asked to be called again.
    iw_time_us_t suspended_us;         ///< Reported by `iw_gateway_suspended` since the last step.
    iw_time_us_t stalled_since_us;     ///< When the first of an unbroken run of stalled steps was due.
    iw_time_us_t pose_us;              ///< When the last pose came; IW_NEVER: none.
    iw_time_us_t purged_us;            ///< When a purge was last tried in this silence; IW_NEVER: not yet.
    iw_setpoint_t setpoint;            ///< Which pair is due.
    iw_permit_t permit;                ///< Whether the wheels may move.
    iw_sender_t sender;                ///< How a pair gets to the bus.
    iw_wheel_t wheel[IW_SIDES];        ///< What is known of each wheel.
    iw_follow_t follow[IW_SIDES];      ///< Whether it does as told.
    iw_diverge_t diverge;              ///< Whether both together do.
    iw_rolling_t rolling;              ///< Whether they turn without a command.
    iw_codec_wheel_t told[IW_SIDES];   ///< Each wheel's last telemetry, message by message.
    iw_force_t force[IW_SIDES];        ///< Its normal force.
    iw_assumption_store_t assumptions; ///< What is assumed of the wheels.
} iw_gateway_t;

/// Checks the configuration, copies it and the HAL, begins in LISTENING. With `restarted` it begins by sending zeros:
/// the process before us died while armed. On a fault the gateway is left untouched and must not be used. The gateway
/// must not be moved or copied afterwards: its parts point to its configuration.
iw_config_fault_t iw_gateway_init(iw_gateway_t *self, const iw_config_t *config, const iw_hal_t *hal,
                                  iw_time_us_t now_us, bool restarted);

/// One complete cycle: e-stop, bus, everything received, judgement, and what is due is sent. Returns when to call
/// again at the latest (never later than one period from now). `now_us` must not go back.
iw_time_us_t iw_gateway_step(iw_gateway_t *self, iw_time_us_t now_us);

/// The whole system was suspended for that long, which the clock of `now_us` did not count: the next step counts it as
/// its own lateness.
void iw_gateway_suspended(iw_gateway_t *self, iw_time_us_t for_us);

/// What the port knows of the bus, whenever it changes.
void iw_gateway_bus_facts(iw_gateway_t *self, const iw_bus_facts_t *facts);

/// Asks to be armed. IW_REFUSE_NONE: poll `iw_gateway_arming` after each step; when false, the state is ARMED with
/// this client as holder, or `iw_gateway_arm_refusal` tells why not.
iw_refusal_t iw_gateway_arm(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover);

/// Commands both wheels, whole or not at all. `*out_applied` is written only if IW_REFUSE_NONE. `sent_us`: when the
/// command was sent, as far as is known, not later than now. The lease runs from then, and a command from before ARMED
/// began is refused as IW_REFUSE_STALE_COMMAND. Commands are passed on in the order in which they were sent: an older
/// one shortens the lease.
iw_refusal_t iw_gateway_drive(iw_gateway_t *self, iw_time_us_t sent_us, iw_client_t client, const iw_drive_t *request,
                              iw_applied_t *out_applied);

/// Ramps down. Needs no lease. `cause`: IW_CAUSE_CLIENT_STOP or IW_CAUSE_SHUTDOWN.
void iw_gateway_stop(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client, iw_cause_t cause);

/// Zero without ramp, latched. Needs no lease.
void iw_gateway_estop(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client);

/// Leaves the latch, if nothing speaks against it.
iw_refusal_t iw_gateway_reset(iw_gateway_t *self, iw_time_us_t now_us);

/// Ends a hold (`iw_config_t::hold`): from now on time ends the zeros, as without it. It permits motion: on a slope the
/// machine rolls. Refused as IW_REFUSE_NOT_AT_REST while the wheels are driven, ramp down, or wait to be armed.
iw_refusal_t iw_gateway_release(iw_gateway_t *self);

/// A client's connection ended.
void iw_gateway_disconnect(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client);

/// Makes the present force of these wheels (bits IW_SIDES_LEFT, IW_SIDES_RIGHT) their zero: all of them, or none if one
/// refuses, which `*out_side` then names.
iw_tare_t iw_gateway_tare(iw_gateway_t *self, iw_time_us_t now_us, uint8_t sides, iw_side_t *out_side);

/// Puts a force offset of an earlier run in force, unless this run has a better one: see `iw_force_restore`.
void iw_gateway_restore_offset(iw_gateway_t *self, iw_side_t side, iw_offset_provenance_t provenance,
                               int32_t offset_mN);

/// Enters what is known of an assumption from elsewhere: the operator's word, what an earlier run found, or
/// observation.h. What the bus shows directly the core enters itself. An entry that is only ASSUMED changes nothing.
void iw_gateway_set_assumption(iw_gateway_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *entry);

#endif
