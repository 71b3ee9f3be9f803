// SPDX-License-Identifier: MIT
#include "iwheel/config.h"

#include "iwheel/codec.h"

#include <string.h>

/// The documented defaults.
static const iw_config_t standard = {
    .force_unit = {IW_FORCE_CN, IW_FORCE_DN},
    .period_ms = 20,
    .lease_ms = 200,
    .accel_mm_s2 = 800,
    .decel_mm_s2 = 1500,
    .max_speed_mm_s = 1000,
    .max_current_mA = IW_CURRENT_LIMIT_mA,
    .min_current_mA = 300,
    .zero_hold_ms = 1500,
    .hold_max_s = 60,
    .wheel_silent_ms = 50,
    .echo_ms = 50,
    .rest_rpm = 2,
    .rest_ms = 200,
    .follow_mm_s = 300,
    .follow_ms = 500,
    .blocked_ms = 1000,
    .pair_mm = 60,
    .pair_leak_ms = 1000,
    .wheel_lag_ms = 60,
    .max_yaw_mrad_s = 1000,
    .yaw_accel_mrad_s2 = 2000,
    .radius_mm = 192,
    .gear_turns = 1,
    .gear_per = 1,
    .setpoint_dlc = IW_DLC_SETPOINT,
};

#define RADIUS_MAX_MM 400

/// Ranges of the numeric fields in the order of iw_config_t, so that one loop checks all of them. The index is
/// iw_config_fault_t - IW_CONFIG_PERIOD.
static const iw_config_range_t ranges[] = {
    {5, 50},                            // period_ms
    {20, 500},                          // lease_ms
    {50, 20000},                        // accel_mm_s2
    {100, 20000},                       // decel_mm_s2
    {10, 5000},                         // max_speed_mm_s
    {300, IW_CURRENT_LIMIT_mA},         // max_current_mA
    {300, IW_CURRENT_LIMIT_mA},         // min_current_mA
    {1100, 5000},                       // zero_hold_ms
    {10, 600},                          // hold_max_s
    {20, 200},                          // wheel_silent_ms
    {20, 200},                          // echo_ms
    {0, 1000},                          // rest_rpm; see check_relations
    {50, 2000},                         // rest_ms
    {50, 500},                          // follow_mm_s
    {100, 1000},                        // follow_ms
    {200, 2000},                        // blocked_ms
    {20, 150},                          // pair_mm
    {500, 3000},                        // pair_leak_ms
    {10, 300},                          // wheel_lag_ms
    {50, 10000},                        // max_yaw_mrad_s
    {100, 10000},                       // yaw_accel_mrad_s2
    {200, 1500},                        // track_mm; or 0, not set
    {60, RADIUS_MAX_MM},                // radius_mm
    {1, 1000},                          // gear_turns
    {1, 1000},                          // gear_per
    {IW_DLC_SETPOINT, IW_CAN_DATA_MAX}, // setpoint_dlc
};
#define FIELDS (sizeof ranges / sizeof ranges[0])
IW_STATIC_ASSERT(FIELDS == IW_CONFIG_SETPOINT_DLC - IW_CONFIG_PERIOD + 1, one_row_per_field);
#define FIRST offsetof(iw_config_t, period_ms)
IW_STATIC_ASSERT(offsetof(iw_config_t, setpoint_dlc) == FIRST + (FIELDS - 1U) * sizeof(uint16_t), numbers_in_a_row);

#define WATCHDOG_MS (IW_WHEEL_WATCHDOG_US / IW_US_PER_MS)
#define GEAR_MAX    100U

#define REST_STANDARD_MM_S 45U
#define REST_MAX_MM_S      60U
/// 1 rpm at a radius of 1 mm is 0.10472 mm/s: 2618 / 25000.
#define RPM_TERM  2618U
#define MM_S_TERM 25000U
// A rotor turns at least as often as its wheel (check_relations), so its rpm are not fewer.
IW_STATIC_ASSERT(REST_STANDARD_MM_S *MM_S_TERM >= RPM_TERM * RADIUS_MAX_MM, one_rpm_is_rest_with_every_wheel);

static uint32_t divide_up(uint32_t numerator, uint32_t denominator) {
    return (numerator + denominator - 1U) / denominator;
}

iw_config_range_t iw_config_range(iw_config_fault_t field) {
    return ranges[field - IW_CONFIG_PERIOD];
}

/// Returns the largest whole rpm of telemetry that is not faster than `speed_mm_s` at the wheel.
static uint32_t slowest_rpm(const iw_config_t *config, uint32_t speed_mm_s) {
    const uint32_t turns = config->rpm_of_rotor ? config->gear_turns : 1U;
    const uint32_t per = config->rpm_of_rotor ? config->gear_per : 1U;
    return speed_mm_s * MM_S_TERM * turns / (RPM_TERM * config->radius_mm * per);
}

iw_config_rest_t iw_config_rest(const iw_config_t *config) {
    const iw_config_rest_t rest = {(uint16_t)slowest_rpm(config, REST_STANDARD_MM_S),
                                   (uint16_t)slowest_rpm(config, REST_MAX_MM_S)};
    return rest;
}

void iw_config_default(iw_config_t *out_config) {
    memcpy(out_config, &standard, sizeof standard);
}

/// Longest time from the last command of a client until the output is zero: lease, period and ramp.
static uint32_t client_lost_ms(const iw_config_t *config) {
    return (uint32_t)config->lease_ms + config->period_ms +
           divide_up(config->max_speed_mm_s * 1000U, config->decel_mm_s2);
}

/// R1: the stop must end before the watchdog of the wheel.
static iw_config_fault_t check_relations(const iw_config_t *config) {
    if (config->current_role > IW_ROLE_SETPOINT) {
        return IW_CONFIG_CURRENT_ROLE;
    }
    if (config->force_unit[IW_LEFT] > IW_FORCE_DN || config->force_unit[IW_RIGHT] > IW_FORCE_DN) {
        return IW_CONFIG_FORCE_UNIT;
    }
    // A gearbox that makes the wheel faster than the rotor is a swapped pair of numbers.
    if (config->gear_turns < config->gear_per || config->gear_turns > GEAR_MAX * config->gear_per) {
        return IW_CONFIG_GEAR_RATIO;
    }
    if (config->rest_rpm > iw_config_rest(config).max) {
        return IW_CONFIG_REST_SPEED;
    }
    if (config->min_current_mA > config->max_current_mA) {
        return IW_CONFIG_MIN_CURRENT;
    }
    return (client_lost_ms(config) > WATCHDOG_MS) ? IW_CONFIG_STOP_BUDGET : IW_CONFIG_OK;
}

iw_config_fault_t iw_config_check(const iw_config_t *config) {
    uint16_t numbers[FIELDS];
    memcpy(numbers, (const uint8_t *)config + FIRST, sizeof numbers);
    if (config->track_mm == 0U) {
        numbers[IW_CONFIG_TRACK - IW_CONFIG_PERIOD] = ranges[IW_CONFIG_TRACK - IW_CONFIG_PERIOD].min;
    }
    for (size_t i = 0; i < FIELDS; i++) {
        if (numbers[i] < ranges[i].min || numbers[i] > ranges[i].max) {
            return (iw_config_fault_t)(IW_CONFIG_PERIOD + i);
        }
    }
    return check_relations(config);
}

/// Converts a distance by setpoints to the configured radius.
static uint32_t real_mm(const iw_config_t *config, uint32_t way_mm) {
    return divide_up(way_mm * config->radius_mm, IW_SETPOINT_RADIUS_MM);
}

iw_stop_budget_t iw_config_stop_budget(const iw_config_t *config) {
    const uint32_t speed = config->max_speed_mm_s;
    const uint32_t wait_ms = (uint32_t)config->lease_ms + config->period_ms;
    iw_stop_budget_t budget;
    // Worst case: the lease ends directly after a pair, with both wheels at the maximum speed. The distance of the
    // ramp is v*v/2a.
    budget.client_lost_ms = client_lost_ms(config);
    const uint32_t lost_mm = divide_up(speed * wait_ms, 1000U) + divide_up(speed * speed, 2U * config->decel_mm_s2);
    budget.client_lost_mm = real_mm(config, lost_mm);
    budget.killed_ms = WATCHDOG_MS;
    budget.killed_mm = real_mm(config, divide_up(speed * WATCHDOG_MS, 1000U));
    return budget;
}
