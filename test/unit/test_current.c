// SPDX-License-Identifier: MIT
// Current limits of a client: the applied pair of limits, and the slope at which limits fall.
#include "iwheel/private/current.h"
#include "unit.h"

static iw_config_t config;

void setUp(void) {
    iw_config_default(&config);
    config.current_role = IW_ROLE_LIMIT;
}

static int32_t larger(int32_t a, int32_t b) {
    return (a > b) ? a : b;
}

/// Compares each pair of limits in steps of 50 mA with the rule.
static void sweep(int32_t lowest, bool zero) {
    for (int32_t left = 0; left <= config.max_current_mA; left += 50) {
        for (int32_t right = 0; right <= config.max_current_mA; right += 50) {
            int32_t limit[IW_SIDES + 1] = {left, right, -7};
            const bool apart = config.asymmetric_current;
            const int32_t wanted[IW_SIDES] = {larger(apart ? left : larger(left, right), lowest),
                                              larger(apart ? right : larger(left, right), lowest)};
            const bool limited = iw_current_limit(&config, limit, zero);
            TEST_ASSERT_EQUAL_INT32_ARRAY(wanted, limit, IW_SIDES);
            TEST_ASSERT_EQUAL_INT32(-7, limit[IW_SIDES]); // There is no third wheel.
            TEST_ASSERT_EQUAL_INT(wanted[IW_LEFT] != left || wanted[IW_RIGHT] != right, limited);
        }
    }
}

TEST(test_current_limit_is_the_larger_side_and_at_least_the_floor) {
    sweep(300, false);
    config.min_current_mA = 1234;
    sweep(1234, false);
}

TEST(test_current_limits_of_sides_differ_only_if_configured) {
    config.asymmetric_current = true;
    sweep(300, false);
}

TEST(test_current_limit_at_two_zero_speeds_is_the_maximum) {
    config.max_current_mA = 1500;
    sweep(1500, true);
    config.asymmetric_current = true;
    sweep(1500, true);
}

TEST(test_current_floor_is_never_above_the_maximum) {
    config.max_current_mA = 200;
    TEST_ASSERT_EQUAL_INT32(200, iw_current_floor(&config));
    sweep(200, false);
    config.max_current_mA = 300;
    TEST_ASSERT_EQUAL_INT32(300, iw_current_floor(&config));
    config.max_current_mA = 301;
    TEST_ASSERT_EQUAL_INT32(300, iw_current_floor(&config));
}

TEST(test_current_limit_falls_by_a_slope_and_rises_immediately) {
    static const struct {
        int16_t from, target;
        uint32_t elapsed_us;
        int16_t expected;
    } cases[] = {
        {2000, 300, 0, 2000},      {2000, 300, 249, 2000},    {2000, 300, 250, 1999}, {2000, 300, 20000, 1920},
        {2000, 1950, 20000, 1950}, {2000, 1920, 20000, 1920}, {2000, 0, 1000000, 0},  {2000, 0, UINT32_MAX, 0},
        {300, 2000, 0, 2000},      {300, 301, 20000, 301},    {500, 500, 20000, 500}, {2000, 300, 424999, 301},
        {2000, 300, 425000, 300},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const iw_pair_t left = {{{0, cases[i].target}, {0, 700}}};
        const iw_pair_t right = {{{0, 700}, {0, cases[i].target}}};
        int16_t limit[IW_SIDES] = {cases[i].from, 700};
        iw_current_follow(limit, &left, cases[i].elapsed_us);
        TEST_ASSERT_EQUAL_INT16(cases[i].expected, limit[IW_LEFT]);
        TEST_ASSERT_EQUAL_INT16(700, limit[IW_RIGHT]);
        limit[IW_LEFT] = 700;
        limit[IW_RIGHT] = cases[i].from;
        iw_current_follow(limit, &right, cases[i].elapsed_us);
        TEST_ASSERT_EQUAL_INT16(700, limit[IW_LEFT]);
        TEST_ASSERT_EQUAL_INT16(cases[i].expected, limit[IW_RIGHT]);
    }
}
