// SPDX-License-Identifier: MIT
/// @file
/// Readable state of a gateway, in one struct. Requests that change it are in gateway.h. Only the core may use the
/// headers in private/.
///
///     iw_snapshot_t now;
///     iw_gateway_snapshot(&gateway, now_us, &now);
///     if (now.state == IW_STATE_ARMED && now.wheel[IW_LEFT].heard) { ... now.wheel[IW_LEFT].speed_mm_s ... }
///
/// The values are those at the time of the call: call `iw_gateway_snapshot` again after a step or a request. A pointer
/// refers to the gateway's own data: it is valid as long as the gateway, and always shows the present values. A step
/// does not update a snapshot, so only callers of `iw_gateway_snapshot` pay for it. All calls belong to the thread that
/// calls `iw_gateway_step`, between two steps.
#ifndef IW_SNAPSHOT_H
#define IW_SNAPSHOT_H

#include "iwheel/codec.h"
#include "iwheel/config.h"
#include "iwheel/force_offset.h"
#include "iwheel/hal.h"
#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

struct iw_gateway;

/// Counters of received frames and requests. They wrap at 32 bits.
typedef struct {
    uint32_t received;     ///< Frames with one of the nine telemetry ids that were read.
    uint32_t echoes;       ///< Echoes of the core's setpoints.
    uint32_t bad_format;   ///< Ignored frames: a known id on a remote, extended, error or FD frame.
    uint32_t bad_length;   ///< Ignored frames: a known id, shorter than in the table.
    uint32_t unknown;      ///< Frames with any other id.
    uint32_t foreign;      ///< Setpoints of another node.
    uint32_t late_steps;   ///< Steps that were later than IW_GATEWAY_LATE_US.
    uint32_t out_of_range; ///< Drive requests that were refused because of their values.
    uint32_t purges;       ///< Purges that the port confirmed.
    uint32_t left_behind;  ///< Times that `iw_snapshot_t::left_behind` became true.
} iw_counters_t;

/// One wheel. Speeds in mm/s and distances are in the machine's frame (`invert` applied), rpm and ticks in the wheel's.
typedef struct {
    const iw_codec_wheel_t *telemetry; ///< Last telemetry by message, as on the bus.
    const iw_force_t *force;           ///< Normal force and its offset.
    iw_time_us_t speed_us;             ///< Reception time of the last speed message; IW_NEVER if there is none.
    iw_time_us_t status_us;            ///< The same for the status message. After a reboot IW_NEVER until the next one.
    int64_t ticks;         ///< Odometry without wraps, across reboots. The distance in nm is `ticks * nm_per_tick`.
    int32_t nm_per_tick;   ///< Distance of one tick in nm. Negative if `invert` is set.
    int32_t speed_mm_s;    ///< Measured speed, rounded towards zero. Valid only if `heard`.
    uint32_t um_s_per_rpm; ///< Speed in um/s at 1 rpm of telemetry.
    uint32_t reboots;      ///< Reboots that were detected since init.
    bool heard;            ///< The last speed message is less than `wheel_silent_ms` old.
    bool at_rest;          ///< `heard`, and the speed was within `rest_rpm` for `rest_ms`.
} iw_snapshot_wheel_t;

/// Readable state of a gateway at one time.
typedef struct {
    iw_time_us_t at_us;                   ///< The `now_us` of the call.
    const iw_config_t *config;            ///< Configuration in use.
    const iw_counters_t *counters;        ///< Counters of received frames since init.
    const iw_sent_t *sent;                ///< Counters of sent frames since init.
    const iw_stop_t *stop;                ///< The last stop; its `number` is 0 if there was none.
    const iw_assumption_entry_t *assumed; ///< Assumptions, indexed by iw_assumption_item_t.
    const iw_time_us_t *seen_us;          ///< Last time of each iw_cause_t; IW_NEVER if it never occurred.
    iw_snapshot_wheel_t wheel[IW_SIDES];  ///< The wheels, indexed by iw_side_t.
    uint32_t stopped;            ///< Frames that the envelope stopped. A nonzero value is an error of the core.
    uint32_t stray_echoes;       ///< Echoes that matched no unconfirmed setpoint.
    iw_time_us_t pose_us;        ///< Reception time of the last pose; IW_NEVER if there is none.
    iw_time_us_t armed_us;       ///< Time at which ARMED began or the lease moved.
    iw_time_us_t lease_until_us; ///< In ARMED: end of the lease, unless another drive command arrives.
    /// Send time of the last nonzero drive command of any client, accepted or not; IW_NEVER if there is none.
    iw_time_us_t stale_us;
    iw_time_us_t waiting_us; ///< Time of the oldest setpoint without TX confirmation; IW_NEVER if there is none.
    /// Send time of the last confirmed setpoint: the older one of the two wheels; 0 until both wheels have one.
    iw_time_us_t confirmed_us;
    iw_client_t holder;       ///< Lease holder, also while arming; IW_CLIENT_NONE if there is none.
    iw_client_t stale_client; ///< Client of `stale_us`.
    iw_pair_t target;         ///< Command of the client after limits; zero unless `demand` is IW_DEMAND_FOLLOW.
    iw_pair_t applied;        ///< Last pair that was sent, after ramps, in the machine's frame.
    /// Bit mask of the latching causes that are present, or were less than a second ago: reset is refused.
    uint32_t present;
    uint32_t assumed_changes; ///< Increases with every change of an assumption.
    int32_t pair_mm;          ///< Deviation from the commanded path, right minus left; positive turns left.
    int32_t pair_largest_mm;  ///< Largest deviation in either direction since ARMED began.
    uint32_t still_moving;    ///< Number of holds that ended after `hold_max_s` while a wheel still turned.
    iw_state_t state;         ///< State that the gateway reports to clients.
    iw_refusal_t arm_refusal; ///< Reason why the last accepted arm request failed; IW_REFUSE_NONE if it did not.
    iw_demand_t demand;       ///< Target of the scheduler since the last step.
    iw_bus_state_t bus;       ///< Last state of the bus.
    iw_assumption_item_t
        doubt;          ///< First contradicted assumption that prevents motion; IW_ASSUMPTION_ITEMS if there is none.
    bool arming;        ///< The core has accepted an arm request and waits for the TX confirmation.
    bool output_zero;   ///< The last pair was zero, or a stop without ramp makes the next one zero.
    bool echo_proven;   ///< See `iw_bus_facts_t`.
    bool holding;       ///< In STOPPING or LATCHED: the core sends zeros without time limit, until release or arm.
    bool zeros_ending;  ///< A wheel still moves after a stop, and the core stops sending zeros within 5 s.
    bool rolling;       ///< A wheel turns faster than 100 mm/s while nothing is sent to it.
    bool rolling_fault; ///< `rolling` began within 10 s after the last setpoint: the machine rolls away.
    /// Nothing is sent, but an unconfirmed setpoint is still in a controller: the port cannot purge it, or has not
    /// purged it within IW_GATEWAY_LOST_ECHO_US. It may reach the bus when the wheels get power.
    bool left_behind;
} iw_snapshot_t;

/// Fills `*out_snapshot`. `now_us`: time of the last step, or later.
void iw_gateway_snapshot(const struct iw_gateway *self, iw_time_us_t now_us, iw_snapshot_t *out_snapshot);

/// Returns whether `iw_force_net_mN` of a wheel is valid, or the reason why not. It considers the sensor and the
/// assumptions about its unit and offset.
iw_force_validity_t iw_snapshot_force_validity(const iw_snapshot_t *self, iw_side_t side);

/// Returns `iw_snapshot_t::state`. This function and the next two are for callers that need no other value.
iw_state_t iw_gateway_state(const struct iw_gateway *self);
/// Returns `iw_snapshot_t::arming`.
bool iw_gateway_arming(const struct iw_gateway *self);
/// Returns `iw_snapshot_t::arm_refusal`.
iw_refusal_t iw_gateway_arm_refusal(const struct iw_gateway *self);

/// Returns true while the demand is not IW_DEMAND_SILENCE: the next steps send setpoints, also zeros.
bool iw_gateway_is_sending(const struct iw_gateway *self);

#ifdef __cplusplus
}
#endif
#endif
