// SPDX-License-Identifier: MIT
/// @file
/// Configuration of the core.
///
/// The names, units, ranges and defaults are those of the gateway's configuration file. The caller fills an
/// `iw_config_t`, starting from `iw_config_default`. `iw_gateway_init` checks it and copies it.
#ifndef IW_CONFIG_H
#define IW_CONFIG_H

#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Radius that the wheel's firmware assumes: a setpoint of 1 mm/s is 1 mm/s at this radius. The core compares measured
/// speeds with setpoints at this radius, whatever `radius_mm` is.
#define IW_SETPOINT_RADIUS_MM 192

/// Ranges are inclusive. No value in a range disables a safety rule. `iw_config_check` refuses a value outside.
/// Short members come first, because a Cortex-M addresses them with shorter instructions.
typedef struct {
    uint8_t setpoint_type;          ///< Byte 0 of a setpoint. Valid only with `setpoint_type_set`: no documented value.
    bool setpoint_type_set;         ///< The wheels do not move until this is true.
    bool rpm_of_rotor;              ///< The rpm in telemetry are those of the rotor, not of the wheel.
    bool listen_only;               ///< The core never sends a frame and refuses arm.
    bool hold;                      ///< Zeros after a stop or a latch end only by `iw_gateway_release` or arm.
    bool asymmetric_current;        ///< With IW_ROLE_LIMIT: a client may set different limits for the two wheels.
    iw_current_role_t current_role; ///< The wheels do not move while it is IW_ROLE_UNSET.
    bool invert[IW_SIDES]; ///< The wheel is mounted mirrored: the core negates its command and its measured speed.
    iw_force_unit_t force_unit[IW_SIDES]; ///< Unit of the raw force.
    uint16_t period_ms;                   ///< Interval between setpoint pairs, 5..50.
    uint16_t lease_ms;        ///< A drive command is valid for this time, 20..500. Use three periods of the client.
    uint16_t accel_mm_s2;     ///< Slope away from zero, 50..20000.
    uint16_t decel_mm_s2;     ///< Slope towards zero, 100..20000. It bounds the stop after a lost client.
    uint16_t max_speed_mm_s;  ///< Largest speed, 10..5000. The core scales faster commands, both wheels by one factor.
    uint16_t max_current_mA;  ///< Largest current, 300..2000. Below it a loaded wheel may have no torque to brake with.
    uint16_t min_current_mA;  ///< With IW_ROLE_LIMIT: smallest limit of a client, 300..`max_current_mA`. Chosen by us.
    uint16_t zero_hold_ms;    ///< Duration of the zeros after a stop, 1100..5000: longer than the 1 s of the wheel.
    uint16_t hold_max_s;      ///< Longest duration of the zeros for a wheel that still moves, 10..600.
    uint16_t wheel_silent_ms; ///< A wheel without telemetry for this time is lost, 20..200.
    uint16_t echo_ms;         ///< A setpoint without echo for this time is stalled, 20..200.
    uint16_t rest_rpm;        ///< A wheel is at standstill if |rpm| <= this, 0..`iw_config_rest_t::max` ...
    uint16_t rest_ms;         ///< ... for this time, 50..2000.
    uint16_t follow_mm_s;     ///< A wheel that is faster than its applied speed by this, 50..500, at 192 mm radius ...
    uint16_t follow_ms;       ///< ... for this time, 100..1000, causes a latch.
    uint16_t blocked_ms;      ///< A wheel below 20 % of its command for this time, 200..2000, stops the pair.
    uint16_t pair_mm;        ///< Deviation from the commanded path, right minus left, at which the pair stops: 20..150.
    uint16_t pair_leak_ms;   ///< Time constant with which a deviation decays, 500..3000.
    uint16_t wheel_lag_ms;   ///< Time constant with which a wheel follows its setpoint, 10..300.
    uint16_t max_yaw_mrad_s; ///< Largest yaw rate, 50..10000. The core scales faster commands by one factor.
    uint16_t yaw_accel_mrad_s2; ///< Largest growth of the yaw rate by a drive command, 100..10000. It slows no stop.
    uint16_t track_mm;          ///< Distance between the wheels, 200..1500. 0: not configured, the wheels do not move.
    uint16_t radius_mm;         ///< Radius of the wheel, 60..400. Document: "approximately 192".
    uint16_t gear_turns;        ///< Rotor turns in `gear_per` wheel turns, 1..1000.
    uint16_t gear_per;          ///< Wheel turns, 1..1000. `gear_turns / gear_per` must be within 1..100.
    uint16_t setpoint_dlc;      ///< Length of a setpoint, 5..8, padded with zeros. The document's table has 5 bytes.
} iw_config_t;

// Fixed by the safety rules.

/// Lease after arm, until the first drive command. Only zeros are sent in this time. Longer than any `lease_ms`.
#define IW_FIRST_LEASE_US 1000000U
/// The core refuses arm and reset this long after a nonzero drive command. No `lease_ms` is longer.
#define IW_STALE_COMMAND_US 500000U
/// The core compares the signs of command and measurement only if both are above this.
#define IW_SIGN_MM_S 100

/// Fault that `iw_config_check` found: first the numeric fields in the order of the struct, then the other fields, then
/// relations between fields.
typedef enum {
    IW_CONFIG_OK = 0,
    IW_CONFIG_PERIOD,
    IW_CONFIG_LEASE,
    IW_CONFIG_ACCEL,
    IW_CONFIG_DECEL,
    IW_CONFIG_MAX_SPEED,
    IW_CONFIG_MAX_CURRENT,
    IW_CONFIG_MIN_CURRENT,
    IW_CONFIG_ZERO_HOLD,
    IW_CONFIG_HOLD_MAX,
    IW_CONFIG_WHEEL_SILENT,
    IW_CONFIG_ECHO,
    IW_CONFIG_REST_RPM,
    IW_CONFIG_REST,
    IW_CONFIG_FOLLOW_SPEED,
    IW_CONFIG_FOLLOW,
    IW_CONFIG_BLOCKED,
    IW_CONFIG_PAIR,
    IW_CONFIG_PAIR_LEAK,
    IW_CONFIG_WHEEL_LAG,
    IW_CONFIG_MAX_YAW,
    IW_CONFIG_YAW_ACCEL,
    IW_CONFIG_TRACK,
    IW_CONFIG_RADIUS,
    IW_CONFIG_GEAR_TURNS,
    IW_CONFIG_GEAR_PER,
    IW_CONFIG_SETPOINT_DLC,
    IW_CONFIG_CURRENT_ROLE, ///< Not an iw_current_role_t.
    IW_CONFIG_FORCE_UNIT,   ///< Not an iw_force_unit_t.
    IW_CONFIG_GEAR_RATIO,   ///< gear_turns / gear_per outside 1..100.
    IW_CONFIG_REST_SPEED,   ///< rest_rpm is more than 60 mm/s at the wheel: `iw_config_rest` returns the largest value.
    IW_CONFIG_STOP_BUDGET,  ///< lease + period + max_speed / decel exceeds 1000 ms, the wheel's own watchdog.
} iw_config_fault_t;

/// Range of a numeric field, inclusive.
typedef struct {
    uint16_t min; ///< Smallest value.
    uint16_t max; ///< Largest value.
} iw_config_range_t;
/// Returns the range of a numeric field. `field`: IW_CONFIG_PERIOD..IW_CONFIG_SETPOINT_DLC.
iw_config_range_t iw_config_range(iw_config_fault_t field);

/// Values of `rest_rpm` for the radius and the gear of a configuration.
typedef struct {
    uint16_t standard; ///< Default: the largest rpm of telemetry that is at most 45 mm/s at the wheel, at least 1.
    uint16_t max;      ///< Limit: the same for 60 mm/s. Above it a rolling wheel would count as at standstill.
} iw_config_rest_t;
/// Returns the values of `rest_rpm` for a configuration whose radius, gear and gear ratio are within their ranges. A
/// caller that changes these sets `rest_rpm` to `standard`.
iw_config_rest_t iw_config_rest(const iw_config_t *config);

/// The documented defaults. Setpoint type, current role and track are not set: they have no safe default.
void iw_config_default(iw_config_t *out_config);

/// Returns IW_CONFIG_OK, or the first field that is out of range, or the first relation that does not hold.
iw_config_fault_t iw_config_check(const iw_config_t *config);

/// Longest time and distance that the machine moves after the last command of a client, rounded up.
typedef struct {
    uint32_t client_lost_ms; ///< The client is lost: lease, one period, and the ramp from the maximum speed.
    uint32_t client_lost_mm; ///< Distance in that time, from the maximum speed and at `radius_mm`.
    uint32_t killed_ms;      ///< The gateway is killed and not restarted: time of the wheel's own watchdog.
    uint32_t killed_mm;      ///< Distance at the maximum speed in that time. The wheel's braking is not documented.
} iw_stop_budget_t;
/// Returns the stop budget of a checked configuration.
iw_stop_budget_t iw_config_stop_budget(const iw_config_t *config);

#ifdef __cplusplus
}
#endif
#endif
