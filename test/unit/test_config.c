// SPDX-License-Identifier: MIT
// Configuration: every value of every field, relations between fields, and the stop budget against figures calculated
// by hand.
#include <string.h>

#include "iwheel/config.h"
#include "unit.h"

#define POISON 0xA5

/// Numeric field: its member, its range from the documentation, and its fault.
typedef struct {
    size_t member;
    uint16_t min;
    uint16_t max;
    iw_config_fault_t fault;
} limit_t;

static const limit_t limits[] = {
    {offsetof(iw_config_t, period_ms), 5, 50, IW_CONFIG_PERIOD},
    {offsetof(iw_config_t, lease_ms), 20, 500, IW_CONFIG_LEASE},
    {offsetof(iw_config_t, accel_mm_s2), 50, 20000, IW_CONFIG_ACCEL},
    {offsetof(iw_config_t, decel_mm_s2), 100, 20000, IW_CONFIG_DECEL},
    {offsetof(iw_config_t, max_speed_mm_s), 10, 5000, IW_CONFIG_MAX_SPEED},
    {offsetof(iw_config_t, max_current_mA), 300, 2000, IW_CONFIG_MAX_CURRENT},
    {offsetof(iw_config_t, min_current_mA), 300, 2000, IW_CONFIG_MIN_CURRENT},
    {offsetof(iw_config_t, zero_hold_ms), 1100, 5000, IW_CONFIG_ZERO_HOLD},
    {offsetof(iw_config_t, hold_max_s), 10, 600, IW_CONFIG_HOLD_MAX},
    {offsetof(iw_config_t, wheel_silent_ms), 20, 200, IW_CONFIG_WHEEL_SILENT},
    {offsetof(iw_config_t, echo_ms), 20, 200, IW_CONFIG_ECHO},
    {offsetof(iw_config_t, rest_rpm), 0, 1000, IW_CONFIG_REST_RPM},
    {offsetof(iw_config_t, rest_ms), 50, 2000, IW_CONFIG_REST},
    {offsetof(iw_config_t, follow_mm_s), 50, 500, IW_CONFIG_FOLLOW_SPEED},
    {offsetof(iw_config_t, follow_ms), 100, 1000, IW_CONFIG_FOLLOW},
    {offsetof(iw_config_t, blocked_ms), 200, 2000, IW_CONFIG_BLOCKED},
    {offsetof(iw_config_t, pair_mm), 20, 150, IW_CONFIG_PAIR},
    {offsetof(iw_config_t, pair_leak_ms), 500, 3000, IW_CONFIG_PAIR_LEAK},
    {offsetof(iw_config_t, wheel_lag_ms), 10, 300, IW_CONFIG_WHEEL_LAG},
    {offsetof(iw_config_t, max_yaw_mrad_s), 50, 10000, IW_CONFIG_MAX_YAW},
    {offsetof(iw_config_t, yaw_accel_mrad_s2), 100, 10000, IW_CONFIG_YAW_ACCEL},
    {offsetof(iw_config_t, track_mm), 200, 1500, IW_CONFIG_TRACK},
    {offsetof(iw_config_t, radius_mm), 60, 400, IW_CONFIG_RADIUS},
    {offsetof(iw_config_t, gear_turns), 1, 1000, IW_CONFIG_GEAR_TURNS},
    {offsetof(iw_config_t, gear_per), 1, 1000, IW_CONFIG_GEAR_PER},
    {offsetof(iw_config_t, setpoint_dlc), 5, 8, IW_CONFIG_SETPOINT_DLC},
};
#define LIMITS (sizeof limits / sizeof limits[0])

static iw_config_t config;

void setUp(void) {
    memset(&config, POISON, sizeof config);
    iw_config_default(&config);
}

static void put(const limit_t *limit, uint16_t value) {
    memcpy((uint8_t *)&config + limit->member, &value, sizeof value);
}

/// Sets a configuration with reserves: no value of one field within its range violates the stop budget, nor the gear
/// ratio if the other number of the ratio follows.
static void make_room(uint16_t gear) {
    iw_config_default(&config);
    config.max_speed_mm_s = 10;
    config.decel_mm_s2 = 20000;
    config.gear_turns = gear;
    config.gear_per = gear;
    config.rest_rpm = 0;
}

TEST(test_config_default_is_the_documented_one) {
    TEST_ASSERT_EQUAL_UINT16(20, config.period_ms);
    TEST_ASSERT_EQUAL_UINT16(200, config.lease_ms);
    TEST_ASSERT_EQUAL_UINT16(800, config.accel_mm_s2);
    TEST_ASSERT_EQUAL_UINT16(1500, config.decel_mm_s2);
    TEST_ASSERT_EQUAL_UINT16(1000, config.max_speed_mm_s);
    TEST_ASSERT_EQUAL_UINT16(2000, config.max_current_mA);
    TEST_ASSERT_EQUAL_UINT16(300, config.min_current_mA);
    TEST_ASSERT_FALSE(config.asymmetric_current);
    TEST_ASSERT_EQUAL_UINT16(1500, config.zero_hold_ms);
    TEST_ASSERT_EQUAL_UINT16(60, config.hold_max_s);
    TEST_ASSERT_EQUAL_UINT16(50, config.wheel_silent_ms);
    TEST_ASSERT_EQUAL_UINT16(50, config.echo_ms);
    TEST_ASSERT_EQUAL_UINT16(2, config.rest_rpm);
    TEST_ASSERT_EQUAL_UINT16(200, config.rest_ms);
    TEST_ASSERT_EQUAL_UINT16(300, config.follow_mm_s);
    TEST_ASSERT_EQUAL_UINT16(500, config.follow_ms);
    TEST_ASSERT_EQUAL_UINT16(1000, config.blocked_ms);
    TEST_ASSERT_EQUAL_UINT16(60, config.pair_mm);
    TEST_ASSERT_EQUAL_UINT16(1000, config.pair_leak_ms);
    TEST_ASSERT_EQUAL_UINT16(60, config.wheel_lag_ms);
    TEST_ASSERT_EQUAL_UINT16(1000, config.max_yaw_mrad_s);
    TEST_ASSERT_EQUAL_UINT16(2000, config.yaw_accel_mrad_s2);
    TEST_ASSERT_EQUAL_UINT16(192, config.radius_mm);
    TEST_ASSERT_EQUAL_UINT16(config.gear_per, config.gear_turns);
    TEST_ASSERT_EQUAL_UINT16(5, config.setpoint_dlc);
    TEST_ASSERT_FALSE(config.rpm_of_rotor);
    TEST_ASSERT_FALSE(config.listen_only);
    TEST_ASSERT_FALSE(config.invert[IW_LEFT]);
    TEST_ASSERT_FALSE(config.invert[IW_RIGHT]);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_CN, config.force_unit[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_DN, config.force_unit[IW_RIGHT]);
}

TEST(test_config_default_leaves_type_role_and_track_unset) {
    TEST_ASSERT_FALSE(config.setpoint_type_set);
    TEST_ASSERT_EQUAL_INT(IW_ROLE_UNSET, config.current_role);
    TEST_ASSERT_EQUAL_UINT16(0, config.track_mm);
}

TEST(test_check_default_is_ok) {
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_config_check(&config));
}

TEST(test_config_range_is_the_documented_one) {
    for (size_t i = 0; i < LIMITS; i++) {
        const iw_config_range_t range = iw_config_range(limits[i].fault);
        TEST_ASSERT_EQUAL_UINT16(limits[i].min, range.min);
        TEST_ASSERT_EQUAL_UINT16(limits[i].max, range.max);
    }
}

TEST(test_config_faults_of_numbers_follow_the_struct_order) {
    for (size_t i = 0; i < LIMITS; i++) {
        TEST_ASSERT_EQUAL_INT((int)i + 1, limits[i].fault);
        TEST_ASSERT_EQUAL_UINT(limits[0].member + i * sizeof(uint16_t), limits[i].member);
    }
}

TEST(test_check_every_value_of_every_field_follows_its_range) {
    for (size_t i = 0; i < LIMITS; i++) {
        for (uint32_t value = 0; value <= 65535; value++) {
            const bool unset = limits[i].fault == IW_CONFIG_TRACK && value == 0;
            const bool within = unset || (value >= limits[i].min && value <= limits[i].max);
            make_room((value >= 1 && value <= 1000) ? (uint16_t)value : 1);
            put(&limits[i], (uint16_t)value);
            const iw_config_fault_t fault = iw_config_check(&config);
            if (limits[i].fault == IW_CONFIG_REST_RPM && value <= 1000) {
                const iw_config_fault_t rest = (value <= 2) ? IW_CONFIG_OK : IW_CONFIG_REST_SPEED;
                if (fault != rest) {
                    TEST_ASSERT_EQUAL_INT(rest, fault);
                }
                continue;
            }
            if (fault != (within ? IW_CONFIG_OK : limits[i].fault)) {
                TEST_ASSERT_EQUAL_INT(within ? IW_CONFIG_OK : limits[i].fault, fault);
            }
        }
    }
}

TEST(test_check_two_faults_names_the_first) {
    for (size_t first = 0; first < LIMITS; first++) {
        for (size_t second = first + 1; second < LIMITS; second++) {
            make_room(1);
            put(&limits[first], 65535);
            put(&limits[second], 65535);
            TEST_ASSERT_EQUAL_INT(limits[first].fault, iw_config_check(&config));
        }
    }
}

TEST(test_check_field_fault_precedes_a_violated_relation) {
    config.lease_ms = 500;
    config.decel_mm_s2 = 100;
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_STOP_BUDGET, iw_config_check(&config));
    config.setpoint_dlc = 9;
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_SETPOINT_DLC, iw_config_check(&config));
}

TEST(test_check_every_defined_role_and_unit_is_ok) {
    for (int role = IW_ROLE_UNSET; role <= IW_ROLE_SETPOINT; role++) {
        for (unsigned units = 0; units < 4; units++) {
            config.current_role = (iw_current_role_t)role;
            config.force_unit[IW_LEFT] = (iw_force_unit_t)(units & 1U);
            config.force_unit[IW_RIGHT] = (iw_force_unit_t)(units >> 1);
            TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_config_check(&config));
        }
    }
}

TEST(test_check_undefined_role_or_unit_is_a_fault) {
    for (int value = IW_ROLE_SETPOINT + 1; value <= UINT8_MAX; value++) { // All values of an enumeration on Cortex-M.
        setUp();
        config.current_role = (iw_current_role_t)value;
        TEST_ASSERT_EQUAL_INT(IW_CONFIG_CURRENT_ROLE, iw_config_check(&config));
        config.current_role = IW_ROLE_LIMIT;
        config.force_unit[IW_LEFT] = (iw_force_unit_t)(value - 1);
        TEST_ASSERT_EQUAL_INT(IW_CONFIG_FORCE_UNIT, iw_config_check(&config));
        config.force_unit[IW_LEFT] = IW_FORCE_DN;
        config.force_unit[IW_RIGHT] = (iw_force_unit_t)(value - 1);
        TEST_ASSERT_EQUAL_INT(IW_CONFIG_FORCE_UNIT, iw_config_check(&config));
    }
}

TEST(test_check_switches_and_types_are_always_ok) {
    for (unsigned bits = 0; bits < 32; bits++) {
        config.setpoint_type_set = (bits & 1U) != 0;
        config.rpm_of_rotor = (bits & 2U) != 0;
        config.listen_only = (bits & 4U) != 0;
        config.invert[IW_LEFT] = (bits & 8U) != 0;
        config.invert[IW_RIGHT] = (bits & 16U) != 0;
        for (unsigned type = 0; type < 256; type++) {
            config.setpoint_type = (uint8_t)type;
            TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_config_check(&config));
        }
    }
}

TEST(test_check_gear_ratio_must_be_within_1_and_100) {
    for (uint16_t turns = 1; turns <= 1000; turns++) {
        for (uint16_t per = 1; per <= 1000; per++) {
            config.gear_turns = turns;
            config.gear_per = per;
            const double ratio = (double)turns / per;
            const iw_config_fault_t wanted = (ratio > 100.0 || ratio < 1.0) ? IW_CONFIG_GEAR_RATIO : IW_CONFIG_OK;
            if (iw_config_check(&config) != wanted) {
                TEST_ASSERT_EQUAL_UINT16_MESSAGE(per, turns, "wrong verdict for this pair");
            }
        }
    }
}

TEST(test_check_stop_budget_is_at_most_one_second) {
    static const struct {
        uint16_t lease_ms;
        uint16_t period_ms;
        uint16_t max_speed_mm_s;
        uint16_t decel_mm_s2;
        iw_config_fault_t fault;
    } cases[] = {
        {200, 20, 780, 1000, IW_CONFIG_OK},           // 200 + 20 + 780
        {200, 20, 781, 1000, IW_CONFIG_STOP_BUDGET},  // 200 + 20 + 781
        {200, 20, 3900, 5000, IW_CONFIG_OK},          // 200 + 20 + 780
        {200, 20, 3901, 5000, IW_CONFIG_STOP_BUDGET}, // 200 + 20 + 780.2
        {201, 20, 780, 1000, IW_CONFIG_STOP_BUDGET},  // 201 + 20 + 780
        {200, 21, 780, 1000, IW_CONFIG_STOP_BUDGET},  // 200 + 21 + 780
        {500, 50, 4500, 10000, IW_CONFIG_OK},         // 500 + 50 + 450
        {500, 50, 4500, 9999, IW_CONFIG_STOP_BUDGET}, // 500 + 50 + 450.05
        {20, 5, 97, 100, IW_CONFIG_OK},               // 20 + 5 + 970
        {20, 5, 98, 100, IW_CONFIG_STOP_BUDGET},      // 20 + 5 + 980
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        config.lease_ms = cases[i].lease_ms;
        config.period_ms = cases[i].period_ms;
        config.max_speed_mm_s = cases[i].max_speed_mm_s;
        config.decel_mm_s2 = cases[i].decel_mm_s2;
        TEST_ASSERT_EQUAL_INT(cases[i].fault, iw_config_check(&config));
    }
}

/// Radius, gear, and the resulting values of rest_rpm. 1 rpm at 192 mm is 20.106 mm/s.
static const struct {
    uint16_t radius_mm;
    bool rotor;
    uint16_t turns;
    uint16_t per;
    iw_config_rest_t rest;
} rests[] = {
    {192, false, 1, 1, {2, 2}},       // 45 / 20.106 = 2.24, 60 / 20.106 = 2.98
    {60, false, 1, 1, {7, 9}},        // 1 rpm is 6.283 mm/s: 7.16, 9.55
    {400, false, 1, 1, {1, 1}},       // 41.888 mm/s: 1.07, 1.43
    {192, false, 27, 2, {2, 2}},      // The gear has no effect if the telemetry counts turns of the wheel.
    {192, true, 27, 2, {30, 40}},     // Turns of the rotor: 1 rpm is 1.4893 mm/s: 30.2, 40.3
    {60, true, 37, 1, {264, 353}},    // 0.16982 mm/s: 264.99, 353.3
    {60, true, 1000, 10, {716, 954}}, // 0.062832 mm/s: 716.2, 954.9
    {400, true, 1000, 1000, {1, 1}},  // Same as without a gear
};

static void set_rest_case(size_t i) {
    iw_config_default(&config);
    config.radius_mm = rests[i].radius_mm;
    config.rpm_of_rotor = rests[i].rotor;
    config.gear_turns = rests[i].turns;
    config.gear_per = rests[i].per;
}

TEST(test_rest_rpm_default_is_at_most_45_mm_s_and_limit_60_mm_s) {
    for (size_t i = 0; i < sizeof rests / sizeof rests[0]; i++) {
        set_rest_case(i);
        TEST_ASSERT_EQUAL_UINT16(rests[i].rest.standard, iw_config_rest(&config).standard);
        TEST_ASSERT_EQUAL_UINT16(rests[i].rest.max, iw_config_rest(&config).max);
        for (uint16_t rpm = 0; rpm <= 1000; rpm++) {
            config.rest_rpm = rpm;
            const iw_config_fault_t fault = iw_config_check(&config);
            const iw_config_fault_t wanted = (rpm <= rests[i].rest.max) ? IW_CONFIG_OK : IW_CONFIG_REST_SPEED;
            if (fault != wanted) {
                TEST_ASSERT_EQUAL_INT(wanted, fault);
            }
        }
    }
}

/// The default is at least 1, and it is permitted with every radius.
TEST(test_rest_rpm_default_is_permitted_with_every_radius) {
    for (uint16_t radius = 60; radius <= 400; radius++) {
        config.radius_mm = radius;
        config.rest_rpm = iw_config_rest(&config).standard;
        TEST_ASSERT_GREATER_OR_EQUAL_UINT16(1, config.rest_rpm);
        TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_config_check(&config));
    }
}

TEST(test_check_current_floor_is_at_most_the_maximum) {
    for (uint16_t max_mA = 300; max_mA <= 2000U; max_mA = (uint16_t)(max_mA + 100U)) {
        config.max_current_mA = max_mA;
        config.min_current_mA = max_mA;
        TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_config_check(&config));
        config.max_current_mA--;
        TEST_ASSERT_EQUAL_INT((max_mA > 300U) ? IW_CONFIG_MIN_CURRENT : IW_CONFIG_MAX_CURRENT,
                              iw_config_check(&config));
    }
}

TEST(test_check_gear_ratio_precedes_rest_and_rest_precedes_budget) {
    config.decel_mm_s2 = 100;
    config.rest_rpm = 3;
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_REST_SPEED, iw_config_check(&config));
    config.gear_per = 2;
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_GEAR_RATIO, iw_config_check(&config));
}

/// The unit of a setpoint is fixed at 192 mm: with another radius the distances differ, not the times.
TEST(test_stop_budget_distances_scale_with_the_radius) {
    static const struct {
        uint16_t radius_mm;
        uint32_t client_lost_mm;
        uint32_t killed_mm;
    } cases[] = {
        {60, 174, 313}, {192, 554, 1000}, {250, 722, 1303}, {400, 1155, 2084}}; // 554 and 1000 mm, by radius / 192
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        config.radius_mm = cases[i].radius_mm;
        const iw_stop_budget_t budget = iw_config_stop_budget(&config);
        TEST_ASSERT_EQUAL_UINT32(887, budget.client_lost_ms);
        TEST_ASSERT_EQUAL_UINT32(1000, budget.killed_ms);
        TEST_ASSERT_EQUAL_UINT32(cases[i].client_lost_mm, budget.client_lost_mm);
        TEST_ASSERT_EQUAL_UINT32(cases[i].killed_mm, budget.killed_mm);
    }
}

TEST(test_check_gear_ratio_precedes_the_stop_budget) {
    config.decel_mm_s2 = 100;
    config.gear_turns = 1000;
    config.gear_per = 1;
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_GEAR_RATIO, iw_config_check(&config));
}

/// The distance has two parts, and each may be rounded up: 1 mm more than calculated is correct, less is a fault.
TEST(test_stop_budget_is_the_hand_calculation_rounded_up) {
    static const struct {
        uint16_t lease_ms;
        uint16_t period_ms;
        uint16_t max_speed_mm_s;
        uint16_t decel_mm_s2;
        iw_stop_budget_t budget;
    } cases[] = {
        {200, 20, 1000, 1500, {887, 554, 1000, 1000}},    // 220 + 666.67 ms; 220 + 333.33 mm
        {200, 20, 780, 1000, {1000, 476, 1000, 780}},     // 220 + 780 ms; 171.6 + 304.2 mm
        {500, 50, 4500, 10000, {1000, 3488, 1000, 4500}}, // 550 + 450 ms; 2475 + 1012.5 mm
        {500, 50, 5000, 20000, {800, 3375, 1000, 5000}},  // 550 + 250 ms; 2750 + 625 mm
        {20, 5, 10, 20000, {26, 1, 1000, 10}},            // 25 + 0.5 ms; 0.25 + 0.0025 mm
        {20, 5, 1000, 1001, {1025, 525, 1000, 1000}},     // 25 + 999.001 ms; 25 + 499.5005 mm
        {100, 20, 1000, 2000, {620, 370, 1000, 1000}},    // 120 + 500 ms; 120 + 250 mm
        {201, 20, 333, 700, {697, 153, 1000, 333}},       // 221 + 475.71 ms; 73.593 + 79.207 mm
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        config.lease_ms = cases[i].lease_ms;
        config.period_ms = cases[i].period_ms;
        config.max_speed_mm_s = cases[i].max_speed_mm_s;
        config.decel_mm_s2 = cases[i].decel_mm_s2;
        const iw_stop_budget_t budget = iw_config_stop_budget(&config);
        TEST_ASSERT_EQUAL_UINT32(cases[i].budget.client_lost_ms, budget.client_lost_ms);
        TEST_ASSERT_GREATER_OR_EQUAL_UINT32(cases[i].budget.client_lost_mm, budget.client_lost_mm);
        TEST_ASSERT_LESS_OR_EQUAL_UINT32(cases[i].budget.client_lost_mm + 1U, budget.client_lost_mm);
        TEST_ASSERT_EQUAL_UINT32(cases[i].budget.killed_ms, budget.killed_ms);
        TEST_ASSERT_EQUAL_UINT32(cases[i].budget.killed_mm, budget.killed_mm);
    }
}
