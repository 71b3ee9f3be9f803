// SPDX-License-Identifier: MIT
/// @file
/// Everything that can be configured in the core, checked once.
///
/// The names, units, ranges and defaults are those of the gateway's configuration file. The caller fills an
/// `iw_config_t` (start from `iw_config_default`), `iw_gateway_init` checks it and copies it.
#ifndef IW_CONFIG_H
#define IW_CONFIG_H

#include "iwheel/types.h"

/// The radius that the wheel's firmware assumes: a setpoint of 1 mm/s means 1 mm/s at this radius. Measured speeds are
/// compared with setpoints in this unit, whatever `radius_mm` is.
#define IW_SETPOINT_RADIUS_MM 192

/// Ranges are inclusive. No value in them switches a safety rule off; a value outside is refused by `iw_config_check`.
/// What is short stands first: a Cortex-M reaches it by shorter instructions.
typedef struct {
    uint8_t setpoint_type;          ///< Byte 0 of a setpoint. The document lists no values: valid only with `..._set`.
    bool setpoint_type_set;         ///< The wheels do not move until this is true.
    bool rpm_of_rotor;              ///< The rpm in telemetry are the rotor's, not the wheel's.
    bool listen_only;               ///< Nothing is ever sent; arm is refused.
    bool hold;                      ///< Zeros after a stop or a latch end only by `iw_gateway_release` or arm.
    bool asymmetric_current;        ///< IW_ROLE_LIMIT: a client may limit one wheel lower than the other.
    iw_current_role_t current_role; ///< The wheels do not move while it is IW_ROLE_UNSET.
    bool invert[IW_SIDES];          ///< This wheel is mounted mirrored: negate its speed, both ways.
    iw_force_unit_t force_unit[IW_SIDES]; ///< As documented unless the wheel proves otherwise.
    uint16_t period_ms;                   ///< Spacing of setpoint pairs, 5..50.
    uint16_t lease_ms;       ///< A drive command holds this long, 20..500. Three client periods are a good value.
    uint16_t accel_mm_s2;    ///< Slope away from zero, 50..20000.
    uint16_t decel_mm_s2;    ///< Slope towards zero, 100..20000. Bounds the stop after a lost client.
    uint16_t max_speed_mm_s; ///< 10..5000. Faster commands are scaled, both wheels by one factor.
    uint16_t max_current_mA; ///< 300..2000: with less a loaded wheel may have no torque to brake with.
    uint16_t min_current_mA; ///< IW_ROLE_LIMIT: no limit of a client is lower, 300..`max_current_mA`. Ours, no physics.
    uint16_t zero_hold_ms;   ///< Zeros are sent this long after a stop, 1100..5000: longer than the wheel's own 1 s.
    uint16_t hold_max_s;     ///< Zeros for a wheel that still moves end after this, 10..600.
    uint16_t wheel_silent_ms; ///< A wheel not heard for this long is lost, 20..200.
    uint16_t echo_ms;         ///< A setpoint not echoed for this long is stalled, 20..200.
    uint16_t rest_rpm;        ///< At rest means |rpm| <= this, at most 60 mm/s at the wheel (iw_config_rest) ...
    uint16_t rest_ms;         ///< ... for this long, 50..2000.
    uint16_t follow_mm_s;     ///< A wheel faster than applied by this, in the unit of setpoints, 50..500 ...
    uint16_t follow_ms;       ///< ... for this long, 100..1000, latches.
    uint16_t blocked_ms;      ///< A wheel below 20 % of its command for this long, 200..2000, stops the pair.
    uint16_t pair_mm;         ///< So far may the pair leave its path, right minus left, 20..150 ...
    uint16_t pair_leak_ms;    ///< ... within about this time, 500..3000. Then it stops.
    uint16_t wheel_lag_ms;    ///< Time constant with which a wheel follows its setpoint, 10..300.
    uint16_t max_yaw_mrad_s;  ///< So fast may a machine turn, 50..10000. Faster commands are scaled down by one factor.
    uint16_t yaw_accel_mrad_s2; ///< So fast may its turning grow under a drive command, 100..10000. No stop is slowed.
    uint16_t track_mm;     ///< Distance of the wheels, 200..1500: yaw by speeds. 0: not set, the wheels do not move.
    uint16_t radius_mm;    ///< Of the wheel, 60..400; the document says "approximately 192".
    uint16_t gear_turns;   ///< Rotor turns in `gear_per` wheel turns, 1..1000.
    uint16_t gear_per;     ///< 1..1000. Together the ratio must lie within 1..100.
    uint16_t setpoint_dlc; ///< 5..8, zero padded. The document's table has 5 bytes.
} iw_config_t;

// Fixed by the safety rules.

/// After arm the lease lasts this long, since only zeros leave before the first drive. Longer than any lease_ms.
#define IW_FIRST_LEASE_US 1000000U
/// A nonzero drive command this recent refuses arm and reset. No lease_ms is longer.
#define IW_STALE_COMMAND_US 500000U
/// Signs are compared only if command and measurement are both above this. Safety rule.
#define IW_SIGN_MM_S 100

/// Which field `iw_config_check` found wrong: the numbers in the order of the struct, the others, relations between
/// fields.
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
    IW_CONFIG_REST_SPEED,   ///< rest_rpm is more than 60 mm/s at the wheel: `iw_config_rest` tells how much is not.
    IW_CONFIG_STOP_BUDGET,  ///< lease + period + max_speed / decel exceeds 1000 ms, the wheel's own watchdog.
} iw_config_fault_t;

/// The inclusive range of the numeric field that a fault in IW_CONFIG_PERIOD..IW_CONFIG_SETPOINT_DLC names.
typedef struct {
    uint16_t min; ///< The least.
    uint16_t max; ///< The most.
} iw_config_range_t;
/// The range of that field.
iw_config_range_t iw_config_range(iw_config_fault_t field);

/// What `rest_rpm` may be with the radius and the gear of a configuration.
typedef struct {
    uint16_t standard; ///< The largest whole rpm of telemetry that is at most 45 mm/s at the wheel, at least 1.
    uint16_t max;      ///< The same for 60 mm/s: more would call a wheel that rolls at rest.
} iw_config_rest_t;
/// Of a configuration whose radius, gear and gear ratio are within their ranges. Whoever sets them sets `rest_rpm` by
/// this.
iw_config_rest_t iw_config_rest(const iw_config_t *config);

/// The documented defaults. Setpoint type, current role and track are left unset: nobody can know them.
void iw_config_default(iw_config_t *out_config);

/// IW_CONFIG_OK, or the first field that is out of range or relation that does not hold.
iw_config_fault_t iw_config_check(const iw_config_t *config);

/// How long (milliseconds, rounded up) and how far (millimetres, rounded up) the machine goes on, at most, after the
/// client's last command: lease, one period, ramp from the maximum speed.
typedef struct {
    uint32_t client_lost_ms; ///< Until the wheels are told to stand, at most.
    uint32_t client_lost_mm; ///< The way in that time, at the maximum speed and at `radius_mm`.
    uint32_t killed_ms;      ///< Gateway killed and not restarted: the wheel's watchdog, then unknown.
    uint32_t killed_mm;      ///< At full command for that time; braking comes on top and is not documented.
} iw_stop_budget_t;
/// Of a configuration that has been checked.
iw_stop_budget_t iw_config_stop_budget(const iw_config_t *config);

#endif
