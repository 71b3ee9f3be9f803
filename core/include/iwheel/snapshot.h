// SPDX-License-Identifier: MIT
/// @file
/// Everything that can be read from a gateway, in one struct. Writing goes through the requests of gateway.h; headers
/// in private/ are for the core alone.
///
///     iw_snapshot_t now;
///     iw_gateway_snapshot(&gateway, now_us, &now);
///     if (now.state == IW_STATE_ARMED && now.wheel[IW_LEFT].heard) { ... now.wheel[IW_LEFT].speed_mm_s ... }
///
/// Values are those of the call: after a step or a request, look again. What stands behind a pointer is the gateway's
/// own, lives as long as it does, and shows what is there when it is read. A step fills nothing: only a look costs.
#ifndef IW_SNAPSHOT_H
#define IW_SNAPSHOT_H

#include "iwheel/codec.h"
#include "iwheel/config.h"
#include "iwheel/force_offset.h"
#include "iwheel/hal.h"
#include "iwheel/types.h"

struct iw_gateway;

/// What was received and how it went. They wrap at 32 bits.
typedef struct {
    uint32_t received;     ///< Frames of the nine telemetry ids that were read.
    uint32_t echoes;       ///< Echoes of our setpoints.
    uint32_t bad_format;   ///< Known id on a remote, extended, error or FD frame: ignored.
    uint32_t bad_length;   ///< Known id, shorter than the table: ignored.
    uint32_t unknown;      ///< Any other id.
    uint32_t foreign;      ///< Setpoints that are not ours.
    uint32_t late_steps;   ///< Steps later than IW_GATEWAY_LATE_US.
    uint32_t out_of_range; ///< Drive requests refused for their values.
    uint32_t purges;       ///< Purges the port confirmed.
    uint32_t left_behind;  ///< Times that an unconfirmed setpoint stayed in a controller: `iw_snapshot_t::left_behind`.
} iw_counters_t;

/// One wheel. mm/s and distance are in the machine's frame of reference (`invert` applied), rpm and ticks in the
/// wheel's.
typedef struct {
    const iw_codec_wheel_t *told; ///< Its last telemetry, message by message, as on the bus.
    const iw_force_t *force;      ///< Its force, and where its zero comes from.
    iw_time_us_t speed_us;        ///< When its last speed frame came; IW_NEVER: none yet.
    iw_time_us_t status_us;       ///< The same of its status; IW_NEVER also after a reboot, until the next one.
    int64_t ticks;                ///< Odometry, unwrapped, across reboots. The distance in nm is `ticks * nm_per_tick`.
    int32_t nm_per_tick;          ///< Negative where `invert` is set.
    int32_t speed_mm_s;           ///< Measured, rounded towards zero. Meaningless while not heard.
    uint32_t um_s_per_rpm;        ///< Speed in um/s at 1 rpm of its telemetry.
    uint32_t reboots;             ///< Seen since init.
    bool heard;                   ///< Its speed was heard less than `wheel_silent_ms` ago.
    bool at_rest;                 ///< Heard, and within `rest_rpm` for `rest_ms`.
} iw_snapshot_wheel_t;

/// What can be known of a gateway at one time.
typedef struct {
    iw_time_us_t at_us;                   ///< The `now_us` of the call.
    const iw_config_t *config;            ///< The one in force.
    const iw_counters_t *counters;        ///< Since init.
    const iw_sent_t *sent;                ///< Since init.
    const iw_stop_t *stop;                ///< The last one; `number` is 0 if there was none.
    const iw_assumption_entry_t *assumed; ///< What is assumed of the wheels, by iw_assumption_item_t.
    const iw_time_us_t *seen_us;          ///< When each iw_cause_t was last seen; IW_NEVER: never.
    iw_snapshot_wheel_t wheel[IW_SIDES];  ///< By iw_side_t.
    uint32_t stopped;                     ///< Frames that the envelope stopped. Nonzero means an error of ours.
    uint32_t stray_echoes;                ///< Echoes that no unconfirmed setpoint matched.
    iw_time_us_t pose_us;                 ///< When the last pose came; IW_NEVER: none.
    iw_time_us_t armed_us;                ///< When ARMED began or the lease was taken over.
    iw_time_us_t lease_until_us;          ///< In ARMED: without another drive command the lease ends here.
    iw_time_us_t stale_us;   ///< The last nonzero drive command of anybody, accepted or not; IW_NEVER: none.
    iw_time_us_t waiting_us; ///< Since when a setpoint waits for its TX confirmation; IW_NEVER: none does.
    /// Of each wheel's last confirmed setpoint: when the older of the two was sent; 0: not both wheels have one yet.
    iw_time_us_t confirmed_us;
    iw_client_t holder;       ///< Of the lease, also while arming; IW_CLIENT_NONE: nobody.
    iw_client_t stale_client; ///< Who sent the command of `stale_us`.
    iw_pair_t target;         ///< What the client commands, after limits; zero unless the demand is to follow.
    iw_pair_t applied;        ///< What the wheels were last told, after ramps, in the machine's frame.
    /// Bit per latching cause that is there now, or happened less than a second ago: reset is refused.
    uint32_t present;
    uint32_t assumed_changes; ///< Grows with every change of what is assumed.
    int32_t pair_mm;          ///< How far the pair has left its path, right against left; positive: to the left.
    int32_t pair_largest_mm;  ///< The largest of it, either way, since ARMED began last.
    uint32_t still_moving;    ///< Holds that ended by their longest time with a wheel not at rest.
    iw_state_t state;         ///< What a client is told.
    iw_refusal_t arm_refusal; ///< Why the last arming failed.
    iw_demand_t demand;       ///< What the scheduler aims at since the last step.
    iw_bus_state_t bus;       ///< As the port reported it last.
    iw_assumption_item_t
        doubt;          ///< The first contradicted assumption that keeps the wheels still; IW_ASSUMPTION_ITEMS: none.
    bool arming;        ///< An arm that was granted waits for its TX confirmation.
    bool output_zero;   ///< The pair last sent was zero, or a stop without ramp has made the next one so.
    bool echo_proven;   ///< See `iw_bus_facts_t`.
    bool holding;       ///< Zeros are held without limit of time, in STOPPING or LATCHED: until release or arm.
    bool zeros_ending;  ///< A wheel still moves after a stop, and in 5 s at the latest nothing is sent to it any more.
    bool rolling;       ///< A wheel turns faster than 100 mm/s and nothing is sent to it.
    bool rolling_fault; ///< That began within 10 s after the last setpoint: the machine rolls away.
    /// Nothing is sent, but an unconfirmed setpoint is still in a controller: the port cannot purge it, or did not
    /// within IW_GATEWAY_LOST_ECHO_US. It may reach the bus when wheels get power.
    bool left_behind;
} iw_snapshot_t;

/// Fills `*out_snapshot`. `now_us`: of the last step, or later.
void iw_gateway_snapshot(const struct iw_gateway *self, iw_time_us_t now_us, iw_snapshot_t *out_snapshot);

/// Whether `iw_force_net_mN` of a wheel's force means anything, and if not, why: what the sensor shows, and what is
/// assumed of its unit and offset.
iw_force_validity_t iw_snapshot_force_validity(const iw_snapshot_t *self, iw_side_t side);

/// `iw_snapshot_t::state` alone, as the three below: for callers that need no more.
iw_state_t iw_gateway_state(const struct iw_gateway *self);
/// `iw_snapshot_t::arming` alone.
bool iw_gateway_arming(const struct iw_gateway *self);
/// `iw_snapshot_t::arm_refusal` alone.
iw_refusal_t iw_gateway_arm_refusal(const struct iw_gateway *self);

/// True while setpoints are sent, or about to be.
bool iw_gateway_is_sending(const struct iw_gateway *self);

#endif
