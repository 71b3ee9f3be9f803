// SPDX-License-Identifier: MIT
/// @file
/// The controller of a pair of wheels. It connects all modules of the core.
///
///     bus -> receive -> decode -> wheel state -> permission -> scheduler -> encode -> envelope -> send -> bus
///
/// The owner calls `iw_gateway_step` when a frame arrives, when the e-stop line has an edge, and at the latest at the
/// time that the last step returned; more calls do no harm. Requests are calls between steps in the same thread of
/// execution. A step directly after a request sends its result without delay. The commands to the wheels depend only on
/// configuration, times, frames and requests: the same recording causes the same bytes on every port.
///
/// The core uses no heap, no floating point and no file-scope state. docs/developer/sizes.md has the size of
/// `iw_gateway_t`.
///
/// R1 to R19 in the comments of the core are the rules of docs/developer/safety-case.md. Fault numbers are rows of its
/// catalogue.
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

#ifdef __cplusplus
extern "C" {
#endif

/// In a step that is later than this, reception times are unknown: its frames neither refresh a wheel nor time it out.
#define IW_GATEWAY_LATE_US 20000U
/// A step that is later than this, or a run of late steps of this length, causes STOPPING without a ramp.
#define IW_GATEWAY_STOP_US 100000U
/// A step that is later than this causes LATCHED.
#define IW_GATEWAY_HUNG_US 500000U
/// If a setpoint has no TX confirmation while nothing is sent, the core calls `purge` immediately and then at this
/// interval.
#define IW_GATEWAY_LOST_ECHO_US 1000000U
/// Largest number of frames that one step receives. A full bus carries 21 in a millisecond.
#define IW_GATEWAY_DRAIN_MAX 512U

/// Facts about the bus that the port has found. All zero if the port knows none.
typedef struct {
    bool timing_contradicted; ///< Bit rate or sample point differ from the configuration: the core refuses arm.
    bool echo_proven;         ///< An echo proves that the frame was on the bus (IFF_ECHO; bxCAN).
} iw_bus_facts_t;

/// A drive request. The core checks the values and refuses a request with a value out of range.
typedef struct {
    int32_t speed_mm_s[IW_SIDES]; ///< In the machine's frame: positive is forward. -32768..32767.
    int32_t current_mA[IW_SIDES]; ///< +/- IW_CURRENT_LIMIT_mA; not negative with IW_ROLE_LIMIT.
    bool has_current;             ///< False requests the configured maximum. Allowed with IW_ROLE_LIMIT only.
} iw_drive_t;

/// Result of a drive request.
typedef struct {
    iw_pair_t pair; ///< The target after limits. The scheduler reaches it by ramps.
    bool limited;   ///< Both speeds or both currents were scaled by one factor, or a current limit raised.
} iw_applied_t;

/// State of the controller. Only the core may use its members; snapshot.h has the values that others may read. Short
/// members come first, because a Cortex-M addresses them with shorter instructions.
typedef struct iw_gateway {
    iw_bus_state_t bus;   ///< State of the bus in this step.
    iw_bus_facts_t facts; ///< The last facts from the port.
    bool backlog;         ///< The last step left received frames in the port.
    bool stalled;         ///< The reception times of this step are unknown: no age is judged.
    /// Nothing is sent, but an unconfirmed setpoint is still in a controller: the port cannot purge it, or has not
    /// purged it within IW_GATEWAY_LOST_ECHO_US. It may reach the bus when the wheels get power.
    bool left_behind;
    uint32_t purged_stop;                 ///< Number of the last stop during whose zeros the core called `purge`.
    iw_counters_t counters;               ///< Counters since init.
    iw_config_t config;                   ///< Copy of the configuration.
    iw_hal_t hal;                         ///< Copy of the HAL.
    iw_time_us_t now_us;                  ///< Time of this step.
    iw_time_us_t promised_us;             ///< Time at which the next step is due.
    iw_time_us_t suspended_us;            ///< Suspended time from `iw_gateway_suspended` since the last step.
    iw_time_us_t stalled_since_us;        ///< Due time of the first step in a run of stalled steps.
    iw_time_us_t pose_us;                 ///< Time of the last pose; IW_NEVER if there is none.
    iw_time_us_t purged_us;               ///< Time of the last purge while nothing is sent; IW_NEVER if there is none.
    iw_setpoint_t setpoint;               ///< Scheduler of setpoint pairs.
    iw_permit_t permit;                   ///< Permission to move.
    iw_sender_t sender;                   ///< Transmission of pairs and their echoes.
    iw_wheel_t wheel[IW_SIDES];           ///< State of each wheel.
    iw_follow_t follow[IW_SIDES];         ///< Comparison of each wheel's speed with its command.
    iw_diverge_t diverge;                 ///< Comparison of the pair's path with the commanded path.
    iw_rolling_t rolling;                 ///< Detection of wheels that turn without a command.
    iw_codec_wheel_t telemetry[IW_SIDES]; ///< Last telemetry of each wheel, by message.
    iw_force_t force[IW_SIDES];           ///< Normal force on each wheel.
    iw_assumption_store_t assumptions;    ///< Assumptions about the wheels.
} iw_gateway_t;

/// Checks the configuration, copies it and the HAL, and enters LISTENING. `restarted`: the previous process died while
/// armed, so the gateway first sends zeros. Returns IW_CONFIG_OK, or the first fault; then `*self` is unchanged and
/// must not be used. The gateway must not be moved or copied later, because its parts point to its configuration.
iw_config_fault_t iw_gateway_init(iw_gateway_t *self, const iw_config_t *config, const iw_hal_t *hal,
                                  iw_time_us_t now_us, bool restarted);

/// Runs one cycle: reads the e-stop, the bus state and all received frames, applies the safety rules, and sends the
/// pair that is due. Returns the latest time of the next call, at most one period from now. `now_us` must not decrease.
iw_time_us_t iw_gateway_step(iw_gateway_t *self, iw_time_us_t now_us);

/// Reports that the system was suspended for `for_us` that the clock of `now_us` did not count. The next step adds it
/// to its lateness.
void iw_gateway_suspended(iw_gateway_t *self, iw_time_us_t for_us);

/// Sets the facts about the bus. The port calls it when they change.
void iw_gateway_bus_facts(iw_gateway_t *self, const iw_bus_facts_t *facts);

/// Requests ARMED for `client`, which must not be IW_CLIENT_NONE. After IW_REFUSE_NONE the caller polls
/// `iw_gateway_arming` after each step. When it is false, the state is ARMED and the client holds the lease, or
/// `iw_gateway_arm_refusal` returns why not. That takes at most `echo_ms`. The first lease is IW_FIRST_LEASE_US long.
/// Any other result changes nothing. `takeover`: while another client is armed, the lease moves to `client`
/// immediately, but only with both wheels at standstill and a last pair of zero. If `client` holds the lease already or
/// waits for it, the call returns IW_REFUSE_NONE and does not extend the lease; IW_REFUSE_CONTRADICTED is possible
/// there too.
iw_refusal_t iw_gateway_arm(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover);

/// Commands both wheels. Writes `*out_applied` only if it returns IW_REFUSE_NONE; a refused command changes neither
/// wheel and does not extend the lease. `sent_us`: time at which the client sent the command, not later than now. The
/// lease starts at that time. A command from before ARMED is refused as IW_REFUSE_STALE_COMMAND. The caller passes
/// commands in the order of `sent_us`, because an older one shortens the lease. After a nonzero command of any client,
/// also a refused one, the core refuses arm and reset for IW_STALE_COMMAND_US.
iw_refusal_t iw_gateway_drive(iw_gateway_t *self, iw_time_us_t sent_us, iw_client_t client, const iw_drive_t *request,
                              iw_applied_t *out_applied);

/// Stops the wheels by a ramp and ends the lease, or ends an arming that waits. Any client may call it. In any other
/// state it stops nothing. `cause`: IW_CAUSE_CLIENT_STOP, or IW_CAUSE_SHUTDOWN, which in every state also ends a hold.
void iw_gateway_stop(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client, iw_cause_t cause);

/// Stops the wheels by zero without a ramp and enters LATCHED. Any client may call it.
void iw_gateway_estop(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client);

/// Leaves LATCHED for LISTENING, or for STOPPING while a hold (`iw_config_t::hold`) lasts. It does not arm. Returns
/// IW_REFUSE_NONE, also if the state is not LATCHED; then nothing changes. It is refused, and the state stays LATCHED,
/// while a latching cause is present or less than a second old (the refusal of that cause), while a wheel is offline
/// (IW_REFUSE_WHEEL_LOST), while a wheel turns or the ramp continues (IW_REFUSE_NOT_AT_REST), and IW_STALE_COMMAND_US
/// after a nonzero drive command (IW_REFUSE_STALE_COMMAND).
iw_refusal_t iw_gateway_reset(iw_gateway_t *self, iw_time_us_t now_us);

/// Ends a hold (`iw_config_t::hold`): the zeros then end after `zero_hold_ms`, as without a hold. A machine on a slope
/// may then roll. Refused as IW_REFUSE_NOT_AT_REST while the wheels are driven, ramp down, or wait to be armed.
iw_refusal_t iw_gateway_release(iw_gateway_t *self);

/// Reports that the connection of `client` has ended. If it holds the lease, the wheels stop by a ramp
/// (IW_CAUSE_CLIENT_GONE) without a latch; if it waits to be armed, that ends with IW_REFUSE_NOT_ARMED. For every other
/// client nothing changes.
void iw_gateway_disconnect(iw_gateway_t *self, iw_time_us_t now_us, iw_client_t client);

/// Makes the mean force of the last IW_FORCE_WINDOW_SAMPLES samples (2 s) the offset of these wheels (IW_SIDES_LEFT,
/// IW_SIDES_RIGHT or IW_SIDES_BOTH). Allowed in every state, with these wheels at standstill and a quiet force that is
/// near the offset in use, unless that offset is in doubt. Returns IW_TARE_OK; or the reason why a wheel refuses, with
/// that wheel in `*out_side`: then no offset changes. Writes `*out_side` only then.
iw_tare_t iw_gateway_tare(iw_gateway_t *self, iw_time_us_t now_us, uint8_t sides, iw_side_t *out_side);

/// Restores a force offset of an earlier run, unless this run has a better one: see `iw_force_restore`.
void iw_gateway_restore_offset(iw_gateway_t *self, iw_side_t side, iw_offset_provenance_t provenance,
                               int32_t offset_mN);

/// Sets an assumption from a source outside the core: the operator, an earlier run, or observation.h. The core sets on
/// its own those that the bus shows directly. An entry with IW_ASSUMED changes nothing.
void iw_gateway_set_assumption(iw_gateway_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *entry);

#ifdef __cplusplus
}
#endif
#endif
