// SPDX-License-Identifier: MIT
#include "iwheel/config.h"

#include "iwheel/codec.h"

#include <string.h>

typedef struct {
    uint16_t standard;
    iw_config_range_t range;
} field_t;

/// Ranges and defaults of the numbers that iw_config_t begins with, in its order: so one loop checks all of them.
/// Indexed by iw_config_fault_t - IW_CONFIG_PERIOD.
static const field_t fields[] = {
    {20, {5, 50}},                                         // period_ms
    {200, {20, 500}},                                      // lease_ms
    {800, {50, 20000}},                                    // accel_mm_s2
    {1500, {100, 20000}},                                  // decel_mm_s2
    {1000, {10, 5000}},                                    // max_speed_mm_s
    {IW_CURRENT_LIMIT_mA, {0, IW_CURRENT_LIMIT_mA}},       // max_current_mA
    {1500, {1100, 5000}},                                  // zero_hold_ms
    {50, {20, 200}},                                       // wheel_silent_ms
    {50, {20, 200}},                                       // echo_ms
    {2, {0, 20}},                                          // rest_rpm
    {200, {50, 2000}},                                     // rest_ms
    {300, {50, 5000}},                                     // follow_mm_s
    {500, {100, 5000}},                                    // follow_ms
    {1000, {200, 10000}},                                  // blocked_ms
    {192, {20, 500}},                                      // radius_mm
    {1, {1, 1000}},                                        // gear_turns
    {1, {1, 1000}},                                        // gear_per
    {IW_DLC_SETPOINT, {IW_DLC_SETPOINT, IW_CAN_DATA_MAX}}, // setpoint_dlc
};
#define FIELDS (sizeof fields / sizeof fields[0])
IW_STATIC_ASSERT(FIELDS == IW_CONFIG_SETPOINT_DLC - IW_CONFIG_PERIOD + 1, one_row_per_field);
IW_STATIC_ASSERT(offsetof(iw_config_t, setpoint_dlc) == (FIELDS - 1U) * sizeof(uint16_t), numbers_come_first);

#define WATCHDOG_MS (IW_WHEEL_WATCHDOG_US / IW_US_PER_MS)
#define GEAR_MAX    100U

static uint32_t divide_up(uint32_t numerator, uint32_t denominator) {
    return (numerator + denominator - 1U) / denominator;
}

iw_config_range_t iw_config_range(iw_config_fault_t field) {
    return fields[field - IW_CONFIG_PERIOD].range;
}

void iw_config_default(iw_config_t *out_config) {
    memset(out_config, 0, sizeof *out_config);
    for (size_t i = 0; i < FIELDS; i++) {
        memcpy((uint8_t *)out_config + i * sizeof(uint16_t), &fields[i].standard, sizeof(uint16_t));
    }
    out_config->force_unit[IW_LEFT] = IW_FORCE_CN;
    out_config->force_unit[IW_RIGHT] = IW_FORCE_DN;
}

/// From the client's last command until the wheels are told to stand, at most: lease, period and ramp.
static uint32_t client_lost_ms(const iw_config_t *config) {
    return (uint32_t)config->lease_ms + config->period_ms +
           divide_up(config->max_speed_mm_s * 1000U, config->decel_mm_s2);
}

/// R1: that must end before the wheel's own watchdog would.
static iw_config_fault_t check_relations(const iw_config_t *config) {
    if (config->current_role > IW_ROLE_SETPOINT) {
        return IW_CONFIG_CURRENT_ROLE;
    }
    if (config->force_unit[IW_LEFT] > IW_FORCE_DN || config->force_unit[IW_RIGHT] > IW_FORCE_DN) {
        return IW_CONFIG_FORCE_UNIT;
    }
    // A gearbox that speeds the wheel up is a swapped pair of numbers.
    if (config->gear_turns < config->gear_per || config->gear_turns > GEAR_MAX * config->gear_per) {
        return IW_CONFIG_GEAR_RATIO;
    }
    return (client_lost_ms(config) > WATCHDOG_MS) ? IW_CONFIG_STOP_BUDGET : IW_CONFIG_OK;
}

iw_config_fault_t iw_config_check(const iw_config_t *config) {
    for (size_t i = 0; i < FIELDS; i++) {
        uint16_t value;
        memcpy(&value, (const uint8_t *)config + i * sizeof value, sizeof value);
        if (value < fields[i].range.min || value > fields[i].range.max) {
            return (iw_config_fault_t)(IW_CONFIG_PERIOD + i);
        }
    }
    return check_relations(config);
}

iw_stop_budget_t iw_config_stop_budget(const iw_config_t *config) {
    const uint32_t speed = config->max_speed_mm_s;
    const uint32_t wait_ms = (uint32_t)config->lease_ms + config->period_ms;
    iw_stop_budget_t budget;
    // Worst case: the lease ends right after a pair was sent, at full speed on both wheels. v*v/2a is the ramp's way.
    budget.client_lost_ms = client_lost_ms(config);
    budget.client_lost_mm = divide_up(speed * wait_ms, 1000U) + divide_up(speed * speed, 2U * config->decel_mm_s2);
    budget.killed_ms = WATCHDOG_MS;
    budget.killed_mm = divide_up(speed * WATCHDOG_MS, 1000U);
    return budget;
}
