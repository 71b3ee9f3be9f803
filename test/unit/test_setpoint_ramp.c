// SPDX-License-Identifier: MIT
// Values of the setpoint pairs: ramps, curves, sign changes, the bound of the stopping time.
#include "setpoint_rig.h"
#include "unit.h"
#include <stdlib.h>

static setpoint_rig_t rig;

void setUp(void) {
    setpoint_rig_init(&rig);
}

static bool between(int32_t low, int32_t value, int32_t high) {
    return (low <= high) ? (value >= low && value <= high) : (value >= high && value <= low);
}

TEST(test_setpoint_acceleration_follows_time_at_every_period) {
    static const uint16_t periods_ms[] = {5, 7, 10, 20, 50};
    static const uint16_t accels[] = {50, 800, 20000};
    for (size_t i = 0; i < 5; i++) {
        for (size_t k = 0; k < 3; k++) {
            setUp();
            rig.config.period_ms = periods_ms[i];
            rig.config.accel_mm_s2 = accels[k];
            rig.config.max_speed_mm_s = 5000;
            setpoint_rig_follow(&rig);
            const iw_time_us_t start_us = rig.now_us;
            setpoint_rig_command(&rig, 5000, -5000, 2000);
            for (uint32_t n = 0; n < 60; n++) {
                const iw_pair_t pair = setpoint_rig_take_next(&rig);
                const int64_t ideal = (int64_t)(rig.now_us - start_us) * accels[k] / 1000000;
                const int64_t expected = (ideal > 5000) ? 5000 : ideal;
                TEST_ASSERT_INT_WITHIN(1, expected, pair.wheel[IW_LEFT].speed_mm_s);
                TEST_ASSERT_INT_WITHIN(1, -expected, pair.wheel[IW_RIGHT].speed_mm_s);
            }
        }
    }
}

TEST(test_setpoint_braking_follows_time_at_every_period) {
    static const uint16_t periods_ms[] = {5, 7, 10, 20, 50};
    for (size_t i = 0; i < 5; i++) {
        setUp();
        rig.config.period_ms = periods_ms[i];
        setpoint_rig_cruise(&rig, 1000, 1000, 2000);
        const iw_time_us_t start_us = rig.now_us;
        setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
        do {
            const iw_pair_t pair = setpoint_rig_take_next(&rig);
            const int64_t ideal = 1000 - (int64_t)(rig.now_us - start_us) * rig.config.decel_mm_s2 / 1000000;
            TEST_ASSERT_INT_WITHIN(1, (ideal < 0) ? 0 : ideal, pair.wheel[IW_LEFT].speed_mm_s);
            TEST_ASSERT_TRUE_MESSAGE(rig.now_us <= start_us + MS(1000), "does not come to zero");
        } while (!setpoint_rig_is_zero(&rig));
    }
}

/// In 32 bits the product of slope and time would wrap to a step of zero after 35 minutes.
TEST(test_setpoint_braking_has_ended_after_any_pause) {
    rig.config.decel_mm_s2 = 2048;
    setpoint_rig_cruise(&rig, 1000, 1000, 2000);
    setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
    const iw_pair_t pair = setpoint_rig_take_after(&rig, MS(2097152));
    TEST_ASSERT_EQUAL_INT(0, pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(0, pair.wheel[IW_RIGHT].speed_mm_s);
}

TEST(test_setpoint_ramps_count_fractions_of_a_millisecond) {
    setpoint_rig_follow(&rig);
    const iw_time_us_t start_us = rig.now_us;
    setpoint_rig_command(&rig, 1000, 1000, 2000);
    for (uint32_t n = 0; n < 40; n++) {
        const iw_pair_t pair = setpoint_rig_take_after(&rig, 20999);
        const int64_t ideal = (int64_t)(rig.now_us - start_us) * 800 / 1000000;
        TEST_ASSERT_INT_WITHIN(1, ideal, pair.wheel[IW_LEFT].speed_mm_s);
    }
}

TEST(test_setpoint_step_of_a_ramp_is_exact_to_the_microsecond) {
    static const struct {
        uint16_t after_us;
        int16_t target_mm_s;
        int16_t expected_mm_s;
    } cases[] = {{20500, 410, 410}, {20999, 420, 419}, {21000, 420, 420}}; // Slope of 20 mm/s per ms.
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        rig.config.accel_mm_s2 = 20000;
        setpoint_rig_follow(&rig);
        setpoint_rig_command(&rig, cases[i].target_mm_s, cases[i].target_mm_s, 2000);
        const iw_pair_t pair = setpoint_rig_take_after(&rig, cases[i].after_us);
        TEST_ASSERT_EQUAL_INT16(cases[i].expected_mm_s, pair.wheel[IW_LEFT].speed_mm_s);
    }
}

TEST(test_setpoint_ramp_after_1_us_is_not_zero_and_continues) {
    rig.config.accel_mm_s2 = 2000;
    setpoint_rig_follow(&rig);
    setpoint_rig_command(&rig, 1, 1, 2000);
    (void)iw_setpoint_next(&rig.setpoint, rig.now_us + 1U);
    TEST_ASSERT_FALSE(setpoint_rig_is_zero(&rig)); // The speed is a thousandth of a mm/s.
    const iw_pair_t pair = setpoint_rig_take_next(&rig);
    TEST_ASSERT_EQUAL_INT16(1, pair.wheel[IW_LEFT].speed_mm_s);
}

TEST(test_setpoint_slower_command_uses_the_slope_towards_zero) {
    setpoint_rig_cruise(&rig, 1000, 1000, 2000);
    setpoint_rig_command(&rig, 100, 100, 2000);
    rig.now_us = iw_setpoint_next_us(&rig.setpoint);
    const iw_time_us_t start_us = rig.setpoint.last_us;
    const iw_pair_t pair = setpoint_rig_take_after(&rig, MS(200) - (rig.now_us - start_us));
    TEST_ASSERT_INT_WITHIN(1, 700, pair.wheel[IW_LEFT].speed_mm_s);
}

TEST(test_setpoint_late_call_accelerates_for_two_periods_at_most) {
    static const uint32_t late_ms[] = {41, 60, 500, 3600000};
    for (size_t i = 0; i < 4; i++) {
        setUp();
        setpoint_rig_follow(&rig);
        setpoint_rig_command(&rig, 1000, 1000, 2000);
        const iw_pair_t pair = setpoint_rig_take_after(&rig, MS(late_ms[i]));
        TEST_ASSERT_TRUE(between(31, pair.wheel[IW_LEFT].speed_mm_s, 32));
        TEST_ASSERT_TRUE(between(31, pair.wheel[IW_RIGHT].speed_mm_s, 32));
    }
}

TEST(test_setpoint_late_call_limit_is_exact_to_the_microsecond) {
    rig.config.period_ms = 50;
    rig.config.accel_mm_s2 = 20000;
    rig.config.max_speed_mm_s = 5000;
    setpoint_rig_follow(&rig);
    setpoint_rig_command(&rig, 5000, 5000, 2000);
    const iw_pair_t pair = setpoint_rig_take_after(&rig, MS(300));
    TEST_ASSERT_TRUE(between(1999, pair.wheel[IW_LEFT].speed_mm_s, 2000));
}

TEST(test_setpoint_late_call_towards_zero_counts_all_of_the_time) {
    setpoint_rig_cruise(&rig, 1000, 600, 2000);
    setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
    const iw_pair_t pair = setpoint_rig_take_after(&rig, MS(400));
    TEST_ASSERT_INT_WITHIN(1, 400, pair.wheel[IW_LEFT].speed_mm_s);
    (void)setpoint_rig_take_after(&rig, MS(267));
    TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
}

TEST(test_setpoint_braking_after_huge_gaps_is_zero) {
    static const uint64_t gaps_us[] = {1000000,     4294967295U, 4294967296U,        4294968296U,
                                       8589934592U, 3600000000U, 281474976710656ULL, 1152921504606846976ULL};
    for (size_t i = 0; i < sizeof gaps_us / sizeof gaps_us[0]; i++) {
        setUp();
        rig.config.decel_mm_s2 = 20000;
        rig.config.max_speed_mm_s = 5000;
        rig.config.accel_mm_s2 = 20000;
        setpoint_rig_cruise(&rig, 5000, -5000, 2000);
        setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
        (void)setpoint_rig_take_after(&rig, gaps_us[i]);
        TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
        TEST_ASSERT_TRUE(iw_setpoint_next_us(&rig.setpoint) > rig.now_us);
        TEST_ASSERT_TRUE(iw_setpoint_next_us(&rig.setpoint) <= rig.now_us + MS(20));
    }
}

TEST(test_setpoint_small_slopes_accumulate) {
    rig.config.period_ms = 5;
    rig.config.accel_mm_s2 = 50;
    setpoint_rig_follow(&rig);
    setpoint_rig_command(&rig, 1000, 1000, 2000);
    for (uint32_t n = 0; n < 200; n++) {
        (void)setpoint_rig_take_next(&rig);
    }
    TEST_ASSERT_INT_WITHIN(1, 50, iw_setpoint_applied(&rig.setpoint).wheel[IW_LEFT].speed_mm_s);
}

/// The curve is retained: left : right stays as 1000 : part.
static void assert_curve_kept(int16_t part) {
    uint32_t moving = 0;
    for (uint32_t n = 0; n < 200; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        const int32_t left = pair.wheel[IW_LEFT].speed_mm_s;
        TEST_ASSERT_INT_WITHIN(1, left * part / 1000, pair.wheel[IW_RIGHT].speed_mm_s);
        moving += (left != 0 && left != 1000) ? 1U : 0U;
    }
    TEST_ASSERT_TRUE(moving > 20);
}

TEST(test_setpoint_both_wheels_ramp_together) {
    static const int16_t parts[] = {1000, 500, 333, 7, 0, -250, -1000};
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) {
        setUp();
        setpoint_rig_follow(&rig);
        setpoint_rig_command(&rig, 1000, parts[i], 2000);
        assert_curve_kept(parts[i]);
        setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
        assert_curve_kept(parts[i]);
        TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
    }
}

TEST(test_setpoint_sign_change_passes_through_zero) {
    setpoint_rig_cruise(&rig, 500, -300, 2000);
    setpoint_rig_command(&rig, -500, 300, 2000);
    iw_pair_t before = iw_setpoint_applied(&rig.setpoint);
    for (uint32_t n = 0; n < 400; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        for (int side = 0; side < IW_SIDES; side++) {
            TEST_ASSERT_TRUE(before.wheel[side].speed_mm_s * pair.wheel[side].speed_mm_s >= 0);
        }
        before = pair;
    }
    TEST_ASSERT_EQUAL_INT(-500, before.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(300, before.wheel[IW_RIGHT].speed_mm_s);
}

TEST(test_setpoint_sign_change_in_a_late_call_ends_near_zero) {
    setpoint_rig_cruise(&rig, 100, 100, 2000);
    setpoint_rig_command(&rig, -1000, -1000, 2000);
    const iw_pair_t pair = setpoint_rig_take_after(&rig, MS(5000));
    TEST_ASSERT_TRUE(pair.wheel[IW_LEFT].speed_mm_s <= 0);
    TEST_ASSERT_TRUE(pair.wheel[IW_LEFT].speed_mm_s >= -32);
}

TEST(test_setpoint_command_counts_under_follow_only) {
    static const iw_demand_t deaf[] = {IW_DEMAND_SILENCE, IW_DEMAND_ZERO, IW_DEMAND_BRAKE};
    for (size_t i = 0; i < 3; i++) {
        setUp();
        setpoint_rig_demand(&rig, deaf[i]);
        setpoint_rig_command(&rig, 1000, 1000, 2000);
        for (uint32_t n = 0; n < 50 && deaf[i] != IW_DEMAND_SILENCE; n++) {
            (void)setpoint_rig_take_next(&rig);
            TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
        }
        setpoint_rig_demand(&rig, IW_DEMAND_FOLLOW);
        for (uint32_t n = 0; n < 50; n++) {
            (void)setpoint_rig_take_next(&rig);
            TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
        }
    }
}

TEST(test_setpoint_command_is_cleared_when_follow_ends) {
    static const iw_demand_t ends[] = {IW_DEMAND_ZERO, IW_DEMAND_BRAKE};
    for (size_t i = 0; i < 2; i++) {
        setUp();
        setpoint_rig_cruise(&rig, 1000, 1000, 2000);
        setpoint_rig_demand(&rig, ends[i]);
        (void)setpoint_rig_take_next(&rig);
        setpoint_rig_demand(&rig, IW_DEMAND_FOLLOW);
        int32_t before = 1000;
        for (uint32_t n = 0; n < 200; n++) {
            const int32_t speed = setpoint_rig_take_next(&rig).wheel[IW_LEFT].speed_mm_s;
            TEST_ASSERT_TRUE(speed <= before);
            before = speed;
        }
        TEST_ASSERT_EQUAL_INT(0, before);
    }
}

TEST(test_setpoint_stays_within_its_target_and_slopes) {
    fixture_random_t random;
    fixture_random_init(&random, 3);
    setpoint_rig_follow(&rig);
    iw_pair_t before = iw_setpoint_applied(&rig.setpoint);
    iw_time_us_t before_us = rig.now_us;
    iw_pair_t target = before;
    for (uint32_t n = 0; n < 30000; n++) {
        if (fixture_random_in(&random, 0, 30) == 0) {
            target.wheel[IW_LEFT].speed_mm_s = (int16_t)fixture_random_in(&random, -1000, 1000);
            target.wheel[IW_RIGHT].speed_mm_s = (int16_t)fixture_random_in(&random, -1000, 1000);
            iw_setpoint_command(&rig.setpoint, rig.now_us, &target);
        }
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        for (int side = 0; side < IW_SIDES; side++) {
            const int32_t was = before.wheel[side].speed_mm_s;
            const int32_t is = pair.wheel[side].speed_mm_s;
            const int32_t slope = (abs(is) > abs(was)) ? rig.config.accel_mm_s2 : rig.config.decel_mm_s2;
            TEST_ASSERT_TRUE(between(was, is, target.wheel[side].speed_mm_s));
            TEST_ASSERT_TRUE(abs(is - was) <= slope * (int32_t)(rig.now_us - before_us) / 1000000 + 1);
        }
        before = pair;
        before_us = rig.now_us;
    }
}

TEST(test_setpoint_reaches_every_target_within_its_ramps) {
    fixture_random_t random;
    fixture_random_init(&random, 4);
    setpoint_rig_follow(&rig);
    for (uint32_t n = 0; n < 200; n++) {
        const int16_t left = (int16_t)fixture_random_in(&random, -1000, 1000);
        const int16_t right = (int16_t)fixture_random_in(&random, -1000, 1000);
        setpoint_rig_command(&rig, left, right, 2000);
        const iw_time_us_t until_us = rig.now_us + MS(667 + 1250 + 40);
        while (iw_setpoint_next_us(&rig.setpoint) <= until_us) {
            (void)setpoint_rig_take_next(&rig);
        }
        const iw_pair_t pair = iw_setpoint_applied(&rig.setpoint);
        TEST_ASSERT_EQUAL_INT(left, pair.wheel[IW_LEFT].speed_mm_s);
        TEST_ASSERT_EQUAL_INT(right, pair.wheel[IW_RIGHT].speed_mm_s);
    }
}

static void brake_at_a_random_moment(fixture_random_t *random) {
    setpoint_rig_follow(&rig);
    const int32_t commands = fixture_random_in(random, 1, 4);
    for (int32_t i = 0; i < commands; i++) {
        setpoint_rig_command(
            &rig, (int16_t)fixture_random_in(random, -(int32_t)rig.config.max_speed_mm_s, rig.config.max_speed_mm_s),
            (int16_t)fixture_random_in(random, -(int32_t)rig.config.max_speed_mm_s, rig.config.max_speed_mm_s),
            (int16_t)fixture_random_in(random, -2000, 2000));
        const iw_time_us_t until_us = rig.now_us + (iw_time_us_t)fixture_random_in(random, 0, 1500000);
        while (iw_setpoint_next_us(&rig.setpoint) <= until_us) {
            (void)setpoint_rig_take_next(&rig);
        }
        rig.now_us = until_us;
    }
    setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
}

TEST(test_setpoint_stop_takes_no_longer_than_the_fastest_ramp) {
    fixture_random_t random;
    fixture_random_init(&random, 5);
    for (uint32_t n = 0; n < 1000; n++) {
        rig.config.period_ms = (uint16_t)fixture_random_in(&random, 5, 50);
        rig.config.max_speed_mm_s = (uint16_t)fixture_random_in(&random, 10, 5000);
        rig.config.accel_mm_s2 = (uint16_t)fixture_random_in(&random, 50, 20000);
        rig.config.decel_mm_s2 = (uint16_t)fixture_random_in(&random, 100, 20000);
        rig.config.current_role = (n & 1U) ? IW_ROLE_SETPOINT : IW_ROLE_LIMIT;
        setpoint_rig_begin(&rig);
        brake_at_a_random_moment(&random);
        const iw_time_us_t until_us =
            rig.now_us + (uint64_t)rig.config.max_speed_mm_s * 1000000U / rig.config.decel_mm_s2 + 1U;
        while (rig.now_us < until_us) {
            (void)setpoint_rig_take_next(&rig);
        }
        TEST_ASSERT_TRUE_MESSAGE(setpoint_rig_is_zero(&rig), "still moving after the longest ramp");
    }
}

TEST(test_setpoint_accelerating_wheel_does_not_delay_the_other) {
    setpoint_rig_cruise(&rig, 1000, 0, 2000);
    const iw_time_us_t start_us = rig.now_us;
    setpoint_rig_command(&rig, 100, 1000, 2000);
    while (rig.now_us < start_us + MS(600)) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        const int64_t ideal = 1000 - (int64_t)(rig.now_us - start_us) * 1500 / 1000000;
        TEST_ASSERT_INT_WITHIN(1, (ideal < 100) ? 100 : ideal, pair.wheel[IW_LEFT].speed_mm_s);
    }
}
