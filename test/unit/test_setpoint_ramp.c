// SPDX-License-Identifier: MIT
// What do setpoint pairs say? Ramps, curves, sign changes, currents, the bound of the stopping time.
#include "fixture.h"
#include "iwheel/setpoint.h"
#include "unity.h"
#include <stdlib.h>
#include <string.h>

static iw_config_t config;
static iw_setpoint_t setpoint;
static iw_time_us_t now_us;

static void restart(void) {
    memset(&setpoint, FIXTURE_POISON, sizeof setpoint);
    iw_setpoint_init(&setpoint, &config);
    now_us = FIXTURE_START_US;
}

void setUp(void) {
    fixture_config(&config);
    restart();
}

void tearDown(void) {}

static void command(int16_t left_mm_s, int16_t right_mm_s, int16_t current_mA) {
    const iw_pair_t target = {{{left_mm_s, current_mA}, {right_mm_s, current_mA}}};
    iw_setpoint_command(&setpoint, now_us, &target);
}

static iw_pair_t take_next(void) {
    iw_pair_t pair;
    now_us = iw_setpoint_next_us(&setpoint);
    iw_setpoint_take(&setpoint, now_us, &pair);
    return pair;
}

static iw_pair_t take_after(iw_time_us_t for_us) {
    iw_pair_t pair;
    now_us += for_us;
    TEST_ASSERT_TRUE(iw_setpoint_due(&setpoint, now_us));
    iw_setpoint_take(&setpoint, now_us, &pair);
    return pair;
}

static void follow(void) {
    iw_setpoint_demand(&setpoint, now_us, IW_DEMAND_FOLLOW);
    now_us = iw_setpoint_next_us(&setpoint) > now_us ? iw_setpoint_next_us(&setpoint) : now_us;
    (void)take_after(0);
}

/// At that speed since a long time.
static void cruise(int16_t left_mm_s, int16_t right_mm_s, int16_t current_mA) {
    follow();
    command(left_mm_s, right_mm_s, current_mA);
    for (uint32_t i = 0; i < 8000U / config.period_ms; i++) {
        (void)take_next();
    }
    const iw_pair_t pair = iw_setpoint_applied(&setpoint);
    TEST_ASSERT_EQUAL_INT(left_mm_s, pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(right_mm_s, pair.wheel[IW_RIGHT].speed_mm_s);
}

static void demand(iw_demand_t aim) {
    iw_setpoint_demand(&setpoint, now_us, aim);
}

static bool between(int32_t low, int32_t value, int32_t high) {
    return low <= high ? (value >= low && value <= high) : (value >= high && value <= low);
}

static void test_setpoint_acceleration_follows_time_at_every_period(void) {
    static const uint16_t periods_ms[] = {5, 7, 10, 20, 50};
    static const uint16_t accels[] = {50, 800, 20000};
    for (size_t i = 0; i < 5; i++) {
        for (size_t k = 0; k < 3; k++) {
            setUp();
            config.period_ms = periods_ms[i];
            config.accel_mm_s2 = accels[k];
            config.max_speed_mm_s = 5000;
            follow();
            const iw_time_us_t start_us = now_us;
            command(5000, -5000, 2000);
            for (uint32_t n = 0; n < 60; n++) {
                const iw_pair_t pair = take_next();
                const int64_t ideal = (int64_t)(now_us - start_us) * accels[k] / 1000000;
                const int64_t expected = ideal > 5000 ? 5000 : ideal;
                TEST_ASSERT_INT_WITHIN(1, expected, pair.wheel[IW_LEFT].speed_mm_s);
                TEST_ASSERT_INT_WITHIN(1, -expected, pair.wheel[IW_RIGHT].speed_mm_s);
            }
        }
    }
}

static void test_setpoint_braking_follows_time_at_every_period(void) {
    static const uint16_t periods_ms[] = {5, 7, 10, 20, 50};
    for (size_t i = 0; i < 5; i++) {
        setUp();
        config.period_ms = periods_ms[i];
        cruise(1000, 1000, 2000);
        const iw_time_us_t start_us = now_us;
        demand(IW_DEMAND_BRAKE);
        do {
            const iw_pair_t pair = take_next();
            const int64_t ideal = 1000 - (int64_t)(now_us - start_us) * config.decel_mm_s2 / 1000000;
            TEST_ASSERT_INT_WITHIN(1, ideal < 0 ? 0 : ideal, pair.wheel[IW_LEFT].speed_mm_s);
        } while (!iw_setpoint_is_zero(&setpoint));
    }
}

static void test_setpoint_slower_command_uses_the_slope_towards_zero(void) {
    cruise(1000, 1000, 2000);
    command(100, 100, 2000);
    now_us = iw_setpoint_next_us(&setpoint);
    const iw_time_us_t start_us = setpoint.last_us;
    const iw_pair_t pair = take_after(MS(200) - (now_us - start_us));
    TEST_ASSERT_INT_WITHIN(1, 700, pair.wheel[IW_LEFT].speed_mm_s);
}

static void test_setpoint_late_call_away_from_zero_is_granted_two_periods(void) {
    static const uint32_t late_ms[] = {41, 60, 500, 3600000};
    for (size_t i = 0; i < 4; i++) {
        setUp();
        follow();
        command(1000, 1000, 2000);
        const iw_pair_t pair = take_after(MS(late_ms[i]));
        TEST_ASSERT_TRUE(between(31, pair.wheel[IW_LEFT].speed_mm_s, 32));
        TEST_ASSERT_TRUE(between(31, pair.wheel[IW_RIGHT].speed_mm_s, 32));
    }
}

static void test_setpoint_late_call_towards_zero_counts_all_of_the_time(void) {
    cruise(1000, 600, 2000);
    demand(IW_DEMAND_BRAKE);
    const iw_pair_t pair = take_after(MS(400));
    TEST_ASSERT_INT_WITHIN(1, 400, pair.wheel[IW_LEFT].speed_mm_s);
    (void)take_after(MS(267));
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
}

static void test_setpoint_braking_after_huge_gaps_is_zero(void) {
    static const uint64_t gaps_us[] = {1000000,     4294967295U, 4294967296U,        4294968296U,
                                       8589934592U, 3600000000U, 281474976710656ULL, 1152921504606846976ULL};
    for (size_t i = 0; i < sizeof gaps_us / sizeof gaps_us[0]; i++) {
        setUp();
        config.decel_mm_s2 = 20000;
        config.max_speed_mm_s = 5000;
        config.accel_mm_s2 = 20000;
        cruise(5000, -5000, 2000);
        demand(IW_DEMAND_BRAKE);
        (void)take_after(gaps_us[i]);
        TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
        TEST_ASSERT_TRUE(iw_setpoint_next_us(&setpoint) > now_us);
        TEST_ASSERT_TRUE(iw_setpoint_next_us(&setpoint) <= now_us + MS(20));
    }
}

static void test_setpoint_small_slopes_accumulate(void) {
    config.period_ms = 5;
    config.accel_mm_s2 = 50;
    follow();
    command(1000, 1000, 2000);
    for (uint32_t n = 0; n < 200; n++) {
        (void)take_next();
    }
    TEST_ASSERT_INT_WITHIN(1, 50, iw_setpoint_applied(&setpoint).wheel[IW_LEFT].speed_mm_s);
}

/// The curve is kept: left : right stays as 1000 : part.
static void assert_curve_kept(int16_t part) {
    uint32_t moving = 0;
    for (uint32_t n = 0; n < 200; n++) {
        const iw_pair_t pair = take_next();
        const int32_t left = pair.wheel[IW_LEFT].speed_mm_s;
        TEST_ASSERT_INT_WITHIN(1, left * part / 1000, pair.wheel[IW_RIGHT].speed_mm_s);
        moving += (left != 0 && left != 1000) ? 1U : 0U;
    }
    TEST_ASSERT_TRUE(moving > 20);
}

static void test_setpoint_both_wheels_ramp_together(void) {
    static const int16_t parts[] = {1000, 500, 333, 7, 0, -250, -1000};
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) {
        setUp();
        follow();
        command(1000, parts[i], 2000);
        assert_curve_kept(parts[i]);
        demand(IW_DEMAND_BRAKE);
        assert_curve_kept(parts[i]);
        TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
    }
}

static void test_setpoint_sign_change_passes_through_zero(void) {
    cruise(500, -300, 2000);
    command(-500, 300, 2000);
    iw_pair_t before = iw_setpoint_applied(&setpoint);
    for (uint32_t n = 0; n < 400; n++) {
        const iw_pair_t pair = take_next();
        for (int side = 0; side < IW_SIDES; side++) {
            TEST_ASSERT_TRUE(before.wheel[side].speed_mm_s * pair.wheel[side].speed_mm_s >= 0);
        }
        before = pair;
    }
    TEST_ASSERT_EQUAL_INT(-500, before.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(300, before.wheel[IW_RIGHT].speed_mm_s);
}

static void test_setpoint_sign_change_in_a_late_call_does_not_jump_over_zero(void) {
    cruise(100, 100, 2000);
    command(-1000, -1000, 2000);
    const iw_pair_t pair = take_after(MS(5000));
    TEST_ASSERT_TRUE(pair.wheel[IW_LEFT].speed_mm_s <= 0);
    TEST_ASSERT_TRUE(pair.wheel[IW_LEFT].speed_mm_s >= -32);
}

static void test_setpoint_collapse_is_zero_within_spacing_and_forgets_the_command(void) {
    cruise(1000, 500, 2000);
    now_us += 1;
    iw_setpoint_collapse(&setpoint, now_us);
    TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&setpoint));
    TEST_ASSERT_FALSE(iw_setpoint_due(&setpoint, now_us + IW_SETPOINT_SPACING_US - 1U));
    (void)take_after(IW_SETPOINT_SPACING_US);
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
    for (uint32_t n = 0; n < 100; n++) {
        (void)take_next();
        TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
    }
    const iw_time_us_t start_us = now_us;
    command(1000, 1000, 2000);
    const iw_pair_t pair = take_next();
    TEST_ASSERT_INT_WITHIN(1, (int64_t)(now_us - start_us) * 800 / 1000000, pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_TRUE(pair.wheel[IW_LEFT].speed_mm_s > 0);
}

static void test_setpoint_command_right_after_a_collapse_does_not_replace_its_zero(void) {
    cruise(1000, 500, 2000);
    iw_setpoint_collapse(&setpoint, now_us);
    command(-700, 1000, 2000);
    TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&setpoint));
    (void)take_after(IW_SETPOINT_SPACING_US);
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
    TEST_ASSERT_FALSE(iw_setpoint_next_is_zero(&setpoint));
    TEST_ASSERT_TRUE(take_next().wheel[IW_LEFT].speed_mm_s < 0);
}

static void test_setpoint_collapse_while_braking_leaves_no_tail(void) {
    cruise(1000, 1000, 2000);
    demand(IW_DEMAND_BRAKE);
    (void)take_next();
    TEST_ASSERT_FALSE(iw_setpoint_is_zero(&setpoint));
    iw_setpoint_collapse(&setpoint, now_us);
    (void)take_after(IW_SETPOINT_SPACING_US);
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
}

static void test_setpoint_command_counts_under_follow_only(void) {
    static const iw_demand_t deaf[] = {IW_DEMAND_SILENCE, IW_DEMAND_ZERO, IW_DEMAND_BRAKE};
    for (size_t i = 0; i < 3; i++) {
        setUp();
        demand(deaf[i]);
        command(1000, 1000, 2000);
        demand(IW_DEMAND_FOLLOW);
        for (uint32_t n = 0; n < 50; n++) {
            (void)take_next();
            TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
        }
    }
}

static void test_setpoint_command_is_forgotten_when_follow_ends(void) {
    static const iw_demand_t ends[] = {IW_DEMAND_ZERO, IW_DEMAND_BRAKE};
    for (size_t i = 0; i < 2; i++) {
        setUp();
        cruise(1000, 1000, 2000);
        demand(ends[i]);
        (void)take_next();
        demand(IW_DEMAND_FOLLOW);
        int32_t before = 1000;
        for (uint32_t n = 0; n < 200; n++) {
            const int32_t speed = take_next().wheel[IW_LEFT].speed_mm_s;
            TEST_ASSERT_TRUE(speed <= before);
            before = speed;
        }
        TEST_ASSERT_EQUAL_INT(0, before);
    }
}

static void test_setpoint_never_passes_its_target_and_never_exceeds_the_slopes(void) {
    fixture_random_t random;
    fixture_random_init(&random, 3);
    follow();
    iw_pair_t before = iw_setpoint_applied(&setpoint);
    iw_time_us_t before_us = now_us;
    iw_pair_t target = before;
    for (uint32_t n = 0; n < 30000; n++) {
        if (fixture_random_in(&random, 0, 30) == 0) {
            target.wheel[IW_LEFT].speed_mm_s = (int16_t)fixture_random_in(&random, -1000, 1000);
            target.wheel[IW_RIGHT].speed_mm_s = (int16_t)fixture_random_in(&random, -1000, 1000);
            iw_setpoint_command(&setpoint, now_us, &target);
        }
        const iw_pair_t pair = take_next();
        for (int side = 0; side < IW_SIDES; side++) {
            const int32_t was = before.wheel[side].speed_mm_s;
            const int32_t is = pair.wheel[side].speed_mm_s;
            const int32_t slope = abs(is) > abs(was) ? config.accel_mm_s2 : config.decel_mm_s2;
            TEST_ASSERT_TRUE(between(was, is, target.wheel[side].speed_mm_s));
            TEST_ASSERT_TRUE(abs(is - was) <= slope * (int32_t)(now_us - before_us) / 1000000 + 1);
        }
        before = pair;
        before_us = now_us;
    }
}

static void test_setpoint_reaches_every_target_within_its_ramps(void) {
    fixture_random_t random;
    fixture_random_init(&random, 4);
    follow();
    for (uint32_t n = 0; n < 200; n++) {
        const int16_t left = (int16_t)fixture_random_in(&random, -1000, 1000);
        const int16_t right = (int16_t)fixture_random_in(&random, -1000, 1000);
        command(left, right, 2000);
        const iw_time_us_t until_us = now_us + MS(667 + 1250 + 40);
        while (iw_setpoint_next_us(&setpoint) <= until_us) {
            (void)take_next();
        }
        const iw_pair_t pair = iw_setpoint_applied(&setpoint);
        TEST_ASSERT_EQUAL_INT(left, pair.wheel[IW_LEFT].speed_mm_s);
        TEST_ASSERT_EQUAL_INT(right, pair.wheel[IW_RIGHT].speed_mm_s);
    }
}

static void brake_at_a_random_moment(fixture_random_t *random) {
    follow();
    const int32_t commands = fixture_random_in(random, 1, 4);
    for (int32_t i = 0; i < commands; i++) {
        command((int16_t)fixture_random_in(random, -(int32_t)config.max_speed_mm_s, config.max_speed_mm_s),
                (int16_t)fixture_random_in(random, -(int32_t)config.max_speed_mm_s, config.max_speed_mm_s),
                (int16_t)fixture_random_in(random, -2000, 2000));
        const iw_time_us_t until_us = now_us + (iw_time_us_t)fixture_random_in(random, 0, 1500000);
        while (iw_setpoint_next_us(&setpoint) <= until_us) {
            (void)take_next();
        }
        now_us = until_us;
    }
    demand(IW_DEMAND_BRAKE);
}

static void test_setpoint_stop_takes_no_longer_than_the_fastest_ramp(void) {
    fixture_random_t random;
    fixture_random_init(&random, 5);
    for (uint32_t n = 0; n < 1000; n++) {
        config.period_ms = (uint16_t)fixture_random_in(&random, 5, 50);
        config.max_speed_mm_s = (uint16_t)fixture_random_in(&random, 10, 5000);
        config.accel_mm_s2 = (uint16_t)fixture_random_in(&random, 50, 20000);
        config.decel_mm_s2 = (uint16_t)fixture_random_in(&random, 100, 20000);
        config.current_role = (n & 1U) ? IW_ROLE_SETPOINT : IW_ROLE_LIMIT;
        restart();
        brake_at_a_random_moment(&random);
        const iw_time_us_t until_us = now_us + (uint64_t)config.max_speed_mm_s * 1000000U / config.decel_mm_s2 + 1U;
        while (now_us < until_us) {
            (void)take_next();
        }
        TEST_ASSERT_TRUE_MESSAGE(iw_setpoint_is_zero(&setpoint), "still moving after the longest ramp");
    }
}

static void test_setpoint_zero_with_a_limit_carries_the_maximum_current(void) {
    config.max_current_mA = 1500;
    follow();
    iw_pair_t pair = iw_setpoint_applied(&setpoint);
    for (int side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_INT(0, pair.wheel[side].speed_mm_s);
        TEST_ASSERT_EQUAL_INT(1500, pair.wheel[side].current_mA);
    }
    cruise(500, 500, 700);
    demand(IW_DEMAND_ZERO);
    pair = take_next();
    TEST_ASSERT_EQUAL_INT(1500, pair.wheel[IW_LEFT].current_mA);
    TEST_ASSERT_EQUAL_INT(1500, pair.wheel[IW_RIGHT].current_mA);
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
}

static void test_setpoint_limit_current_is_not_ramped(void) {
    follow();
    const iw_pair_t target = {{{1000, 700}, {1000, 300}}};
    iw_setpoint_command(&setpoint, now_us, &target);
    const iw_pair_t pair = take_next();
    TEST_ASSERT_EQUAL_INT(700, pair.wheel[IW_LEFT].current_mA);
    TEST_ASSERT_EQUAL_INT(300, pair.wheel[IW_RIGHT].current_mA);
}

static void test_setpoint_zero_with_a_current_setpoint_carries_no_current(void) {
    config.current_role = IW_ROLE_SETPOINT;
    cruise(500, -500, 1200);
    TEST_ASSERT_EQUAL_INT(1200, iw_setpoint_applied(&setpoint).wheel[IW_LEFT].current_mA);
    demand(IW_DEMAND_ZERO);
    const iw_pair_t pair = take_next();
    for (int side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_INT(0, pair.wheel[side].speed_mm_s);
        TEST_ASSERT_EQUAL_INT(0, pair.wheel[side].current_mA);
    }
}

static void test_setpoint_current_setpoint_scales_with_the_speed(void) {
    config.current_role = IW_ROLE_SETPOINT;
    follow();
    command(1000, -1000, 2000);
    for (uint32_t n = 0; n < 100; n++) {
        const iw_pair_t pair = take_next();
        TEST_ASSERT_INT_WITHIN(4, abs(pair.wheel[IW_LEFT].speed_mm_s) * 2, pair.wheel[IW_LEFT].current_mA);
    }
    demand(IW_DEMAND_BRAKE);
    for (uint32_t n = 0; n < 30; n++) {
        const iw_pair_t pair = take_next();
        TEST_ASSERT_INT_WITHIN(4, abs(pair.wheel[IW_LEFT].speed_mm_s) * 2, pair.wheel[IW_LEFT].current_mA);
    }
}

static void test_setpoint_current_without_speed_is_no_zero_and_stops_in_time(void) {
    config.current_role = IW_ROLE_SETPOINT;
    follow();
    command(0, 0, 2000);
    for (uint32_t n = 0; n < 400; n++) {
        (void)take_next();
    }
    TEST_ASSERT_EQUAL_INT(2000, iw_setpoint_applied(&setpoint).wheel[IW_RIGHT].current_mA);
    TEST_ASSERT_FALSE(iw_setpoint_is_zero(&setpoint));
    demand(IW_DEMAND_BRAKE);
    const iw_time_us_t until_us = now_us + 666667U;
    while (now_us < until_us) {
        (void)take_next();
    }
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
    TEST_ASSERT_EQUAL_INT(0, iw_setpoint_applied(&setpoint).wheel[IW_RIGHT].current_mA);
}

static void test_setpoint_next_is_zero_only_if_neither_ramp_nor_command_remain(void) {
    static const iw_current_role_t roles[] = {IW_ROLE_LIMIT, IW_ROLE_SETPOINT};
    for (size_t i = 0; i < 2; i++) {
        setUp();
        config.current_role = roles[i];
        follow();
        TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&setpoint));
        command(1, 0, 0);
        TEST_ASSERT_FALSE(iw_setpoint_next_is_zero(&setpoint));
        command(0, -1, 0);
        TEST_ASSERT_FALSE(iw_setpoint_next_is_zero(&setpoint));
        command(0, 0, 1);
        TEST_ASSERT_EQUAL_INT(roles[i] == IW_ROLE_LIMIT, iw_setpoint_next_is_zero(&setpoint));
        const iw_pair_t right_current = {{{0, 0}, {0, 5}}};
        iw_setpoint_command(&setpoint, now_us, &right_current);
        TEST_ASSERT_EQUAL_INT(roles[i] == IW_ROLE_LIMIT, iw_setpoint_next_is_zero(&setpoint));
        command(0, 600, 0);
        (void)take_next();
        (void)take_next();
        command(0, 0, 0);
        TEST_ASSERT_FALSE(iw_setpoint_next_is_zero(&setpoint));
        demand(IW_DEMAND_ZERO);
        TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&setpoint));
    }
}

static void test_setpoint_accelerating_wheel_does_not_hold_up_a_braking_one(void) {
    cruise(1000, 0, 2000);
    const iw_time_us_t start_us = now_us;
    command(100, 1000, 2000);
    while (now_us < start_us + MS(600)) {
        const iw_pair_t pair = take_next();
        const int64_t ideal = 1000 - (int64_t)(now_us - start_us) * 1500 / 1000000;
        TEST_ASSERT_INT_WITHIN(1, ideal < 100 ? 100 : ideal, pair.wheel[IW_LEFT].speed_mm_s);
    }
}

static void test_setpoint_current_setpoint_changes_sign_through_zero(void) {
    config.current_role = IW_ROLE_SETPOINT;
    cruise(500, 500, 1500);
    command(500, 500, -1500);
    int32_t before = 1500;
    for (uint32_t n = 0; n < 400; n++) {
        const int32_t current = take_next().wheel[IW_LEFT].current_mA;
        TEST_ASSERT_TRUE(current <= before);
        TEST_ASSERT_TRUE(before * current >= 0);
        before = current;
    }
    TEST_ASSERT_EQUAL_INT(-1500, before);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_setpoint_acceleration_follows_time_at_every_period);
    RUN_TEST(test_setpoint_braking_follows_time_at_every_period);
    RUN_TEST(test_setpoint_slower_command_uses_the_slope_towards_zero);
    RUN_TEST(test_setpoint_late_call_away_from_zero_is_granted_two_periods);
    RUN_TEST(test_setpoint_late_call_towards_zero_counts_all_of_the_time);
    RUN_TEST(test_setpoint_braking_after_huge_gaps_is_zero);
    RUN_TEST(test_setpoint_small_slopes_accumulate);
    RUN_TEST(test_setpoint_both_wheels_ramp_together);
    RUN_TEST(test_setpoint_sign_change_passes_through_zero);
    RUN_TEST(test_setpoint_sign_change_in_a_late_call_does_not_jump_over_zero);
    RUN_TEST(test_setpoint_collapse_is_zero_within_spacing_and_forgets_the_command);
    RUN_TEST(test_setpoint_command_right_after_a_collapse_does_not_replace_its_zero);
    RUN_TEST(test_setpoint_collapse_while_braking_leaves_no_tail);
    RUN_TEST(test_setpoint_command_counts_under_follow_only);
    RUN_TEST(test_setpoint_command_is_forgotten_when_follow_ends);
    RUN_TEST(test_setpoint_never_passes_its_target_and_never_exceeds_the_slopes);
    RUN_TEST(test_setpoint_reaches_every_target_within_its_ramps);
    RUN_TEST(test_setpoint_stop_takes_no_longer_than_the_fastest_ramp);
    RUN_TEST(test_setpoint_zero_with_a_limit_carries_the_maximum_current);
    RUN_TEST(test_setpoint_limit_current_is_not_ramped);
    RUN_TEST(test_setpoint_zero_with_a_current_setpoint_carries_no_current);
    RUN_TEST(test_setpoint_current_setpoint_scales_with_the_speed);
    RUN_TEST(test_setpoint_current_without_speed_is_no_zero_and_stops_in_time);
    RUN_TEST(test_setpoint_next_is_zero_only_if_neither_ramp_nor_command_remain);
    RUN_TEST(test_setpoint_accelerating_wheel_does_not_hold_up_a_braking_one);
    RUN_TEST(test_setpoint_current_setpoint_changes_sign_through_zero);
    return UNITY_END();
}
