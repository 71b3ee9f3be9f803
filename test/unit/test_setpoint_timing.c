// SPDX-License-Identifier: MIT
// Times of the setpoint pairs: grid, spacing, silence, lateness.
#include "fixture.h"
#include "iwheel/private/setpoint.h"
#include "unit.h"
#include <string.h>

static iw_config_t config;
static iw_setpoint_t setpoint;

void setUp(void) {
    fixture_config(&config);
    memset(&setpoint, FIXTURE_POISON, sizeof setpoint);
    iw_setpoint_init(&setpoint, &config);
}

static iw_pair_t pair_of(int16_t left_mm_s, int16_t right_mm_s) {
    const iw_pair_t pair = {{{left_mm_s, 2000}, {right_mm_s, 2000}}};
    return pair;
}

static iw_pair_t take_at(iw_time_us_t now_us) {
    TEST_ASSERT_TRUE_MESSAGE(iw_setpoint_due(&setpoint, now_us), "a pair must be due");
    return iw_setpoint_next(&setpoint, now_us);
}

static void command_at(iw_time_us_t now_us, int16_t left_mm_s, int16_t right_mm_s) {
    const iw_pair_t target = pair_of(left_mm_s, right_mm_s);
    iw_setpoint_command(&setpoint, now_us, &target);
}

/// Sends every pair when it is due, until `until_us`, and returns the time of the last one.
static iw_time_us_t run_until(iw_time_us_t until_us) {
    iw_time_us_t last_us = 0;
    while (iw_setpoint_next_us(&setpoint) <= until_us) {
        last_us = iw_setpoint_next_us(&setpoint);
        take_at(last_us);
    }
    return last_us;
}

/// FOLLOW with the first pair at `start_us`, until `left` and `right` are reached.
static iw_time_us_t cruise(iw_time_us_t start_us, int16_t left_mm_s, int16_t right_mm_s) {
    iw_setpoint_demand(&setpoint, start_us, IW_DEMAND_FOLLOW);
    take_at(start_us);
    command_at(start_us, left_mm_s, right_mm_s);
    return run_until(start_us + MS(8000));
}

static void assert_only_due_from(iw_time_us_t due_us) {
    TEST_ASSERT_FALSE_MESSAGE(iw_setpoint_due(&setpoint, due_us - 1U), "due too early");
    TEST_ASSERT_TRUE_MESSAGE(iw_setpoint_due(&setpoint, due_us), "not due");
    TEST_ASSERT_TRUE(iw_setpoint_next_us(&setpoint) == due_us);
}

static void assert_silent(iw_time_us_t now_us) {
    TEST_ASSERT_FALSE(iw_setpoint_due(&setpoint, now_us));
    TEST_ASSERT_FALSE(iw_setpoint_due(&setpoint, now_us + MS(3600000)));
    TEST_ASSERT_TRUE(iw_setpoint_next_us(&setpoint) == IW_NEVER);
}

TEST(test_setpoint_after_init_is_never_due) {
    assert_silent(0);
    assert_silent(FIXTURE_START_US);
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
    iw_setpoint_collapse(&setpoint, FIXTURE_START_US);
    assert_silent(FIXTURE_START_US);
    iw_setpoint_hasten(&setpoint, FIXTURE_START_US);
    assert_silent(FIXTURE_START_US);
}

TEST(test_setpoint_first_pair_at_clock_start_is_due_immediately) {
    iw_setpoint_demand(&setpoint, 1000, IW_DEMAND_FOLLOW);
    assert_only_due_from(1000);
}

TEST(test_setpoint_hasten_moves_the_pair_forward_with_spacing) {
    iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_BRAKE);
    take_at(FIXTURE_START_US);
    iw_setpoint_hasten(&setpoint, FIXTURE_START_US + MS(2));
    assert_only_due_from(FIXTURE_START_US + IW_SETPOINT_SPACING_US);
    iw_setpoint_hasten(&setpoint, FIXTURE_START_US + MS(9));
    assert_only_due_from(FIXTURE_START_US + IW_SETPOINT_SPACING_US);
}

TEST(test_setpoint_late_pair_returns_to_the_grid_with_spacing) {
    iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_ZERO);
    take_at(FIXTURE_START_US);
    take_at(FIXTURE_START_US + MS(35));
    assert_only_due_from(FIXTURE_START_US + MS(40));
    take_at(FIXTURE_START_US + MS(55) + 1U);
    assert_only_due_from(FIXTURE_START_US + MS(75) + 1U);
}

TEST(test_setpoint_demand_from_silence_is_due_with_zero) {
    static const iw_demand_t demands[] = {IW_DEMAND_ZERO, IW_DEMAND_BRAKE, IW_DEMAND_FOLLOW};
    for (size_t i = 0; i < sizeof demands / sizeof demands[0]; i++) {
        setUp();
        iw_setpoint_demand(&setpoint, FIXTURE_START_US, demands[i]);
        TEST_ASSERT_TRUE(iw_setpoint_next_us(&setpoint) <= FIXTURE_START_US);
        command_at(FIXTURE_START_US, 1000, 1000);
        const iw_pair_t first = take_at(FIXTURE_START_US);
        TEST_ASSERT_EQUAL_INT(0, first.wheel[IW_LEFT].speed_mm_s);
        TEST_ASSERT_EQUAL_INT(0, first.wheel[IW_RIGHT].speed_mm_s);
        assert_only_due_from(FIXTURE_START_US + MS(20));
    }
}

TEST(test_setpoint_first_pair_sent_late_is_zero) {
    iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_FOLLOW);
    command_at(FIXTURE_START_US, 1000, 1000);
    take_at(FIXTURE_START_US + MS(700));
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
}

TEST(test_setpoint_grid_does_not_drift_over_10000_late_pairs) {
    fixture_random_t random;
    fixture_random_init(&random, 1);
    static const uint16_t periods_ms[] = {5, 20, 33, 50};
    for (size_t i = 0; i < sizeof periods_ms / sizeof periods_ms[0]; i++) {
        config.period_ms = periods_ms[i];
        iw_setpoint_init(&setpoint, &config);
        iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_ZERO);
        take_at(FIXTURE_START_US);
        for (uint32_t n = 1; n <= 10000; n++) {
            const iw_time_us_t due_us = FIXTURE_START_US + (iw_time_us_t)n * MS(periods_ms[i]);
            assert_only_due_from(due_us);
            take_at(due_us + (iw_time_us_t)fixture_random_in(&random, 0, 1000 * (periods_ms[i] - 5)));
        }
    }
}

TEST(test_setpoint_late_call_sends_one_pair_and_no_burst) {
    iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_FOLLOW);
    take_at(FIXTURE_START_US);
    static const uint32_t late_ms[] = {21, 39, 41, 110, 990, 3599990};
    iw_time_us_t last_us = FIXTURE_START_US;
    for (size_t i = 0; i < sizeof late_ms / sizeof late_ms[0]; i++) {
        const iw_time_us_t now_us = last_us + MS(late_ms[i]);
        take_at(now_us);
        TEST_ASSERT_FALSE_MESSAGE(iw_setpoint_due(&setpoint, now_us), "a burst");
        const iw_time_us_t next_us = iw_setpoint_next_us(&setpoint);
        TEST_ASSERT_TRUE(next_us >= now_us + IW_SETPOINT_SPACING_US);
        TEST_ASSERT_TRUE(next_us <= now_us + MS(20));
        take_at(next_us);
        last_us = next_us;
    }
}

TEST(test_setpoint_late_pair_retains_the_spacing) {
    iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_FOLLOW);
    take_at(FIXTURE_START_US);
    take_at(FIXTURE_START_US + MS(39));
    command_at(FIXTURE_START_US + MS(39), 500, 500);
    const iw_time_us_t next_us = iw_setpoint_next_us(&setpoint);
    TEST_ASSERT_TRUE(next_us > FIXTURE_START_US + MS(39));
    TEST_ASSERT_TRUE(next_us <= FIXTURE_START_US + MS(44));
}

TEST(test_setpoint_changed_command_is_due_after_the_spacing) {
    iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_FOLLOW);
    take_at(FIXTURE_START_US);
    command_at(FIXTURE_START_US + MS(1), 500, 500);
    assert_only_due_from(FIXTURE_START_US + IW_SETPOINT_SPACING_US);
}

TEST(test_setpoint_changed_command_past_the_spacing_is_due_now) {
    static const uint32_t after_us[] = {5000, 5001, 12345, 19999};
    for (size_t i = 0; i < sizeof after_us / sizeof after_us[0]; i++) {
        setUp();
        iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_FOLLOW);
        take_at(FIXTURE_START_US);
        const iw_time_us_t now_us = FIXTURE_START_US + after_us[i];
        TEST_ASSERT_FALSE(iw_setpoint_due(&setpoint, now_us));
        command_at(now_us, 500, 400);
        TEST_ASSERT_TRUE(iw_setpoint_due(&setpoint, now_us));
        take_at(now_us);
        TEST_ASSERT_TRUE(iw_setpoint_next_us(&setpoint) > now_us);
        TEST_ASSERT_TRUE(iw_setpoint_next_us(&setpoint) <= now_us + MS(20));
    }
}

TEST(test_setpoint_change_of_one_wheel_or_current_is_due) {
    const iw_time_us_t last_us = cruise(FIXTURE_START_US, 300, 300);
    const iw_pair_t changes[] = {{{{301, 2000}, {300, 2000}}},
                                 {{{301, 2000}, {301, 2000}}},
                                 {{{301, 1999}, {301, 2000}}},
                                 {{{301, 1999}, {301, 1000}}}};
    iw_time_us_t now_us = last_us;
    for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++) {
        now_us += MS(6);
        iw_setpoint_command(&setpoint, now_us, &changes[i]);
        take_at(now_us);
    }
}

TEST(test_setpoint_same_command_again_does_not_move_the_pair) {
    const iw_time_us_t last_us = cruise(FIXTURE_START_US, 300, -300);
    command_at(last_us + MS(7), 300, -300);
    assert_only_due_from(last_us + MS(20));
}

TEST(test_setpoint_command_burst_is_spaced_without_a_missing_pair) {
    iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_FOLLOW);
    take_at(FIXTURE_START_US);
    iw_time_us_t last_us = FIXTURE_START_US;
    uint32_t pairs = 0;
    for (iw_time_us_t now_us = FIXTURE_START_US; now_us < FIXTURE_START_US + MS(1000); now_us += 250) {
        command_at(now_us, (int16_t)(now_us % 700), (int16_t)(now_us % 500));
        if (iw_setpoint_due(&setpoint, now_us)) {
            TEST_ASSERT_TRUE(now_us - last_us >= IW_SETPOINT_SPACING_US);
            take_at(now_us);
            last_us = now_us;
            pairs++;
        }
    }
    TEST_ASSERT_UINT_WITHIN(2, 200, pairs);
}

TEST(test_setpoint_gap_stays_within_a_period_at_any_command) {
    fixture_random_t random;
    fixture_random_init(&random, 2);
    iw_setpoint_demand(&setpoint, FIXTURE_START_US, IW_DEMAND_FOLLOW);
    take_at(FIXTURE_START_US);
    iw_time_us_t now_us = FIXTURE_START_US;
    iw_time_us_t last_us = now_us;
    for (uint32_t n = 0; n < 20000; n++) {
        const iw_time_us_t next_us = iw_setpoint_next_us(&setpoint);
        const iw_time_us_t input_us = now_us + (iw_time_us_t)fixture_random_in(&random, 1, 30000);
        if (input_us < next_us) {
            now_us = input_us;
            const int16_t left_mm_s = (int16_t)fixture_random_in(&random, -9, 9);
            command_at(now_us, left_mm_s, (int16_t)fixture_random_in(&random, -9, 9));
            continue;
        }
        now_us = next_us;
        take_at(now_us);
        TEST_ASSERT_TRUE(now_us - last_us <= MS(20));
        TEST_ASSERT_TRUE(now_us - last_us >= IW_SETPOINT_SPACING_US);
        last_us = now_us;
    }
}

TEST(test_setpoint_changed_demand_moves_the_pair_forward) {
    const iw_time_us_t last_us = cruise(FIXTURE_START_US, 300, 300);
    iw_setpoint_demand(&setpoint, last_us + MS(2), IW_DEMAND_BRAKE);
    assert_only_due_from(last_us + IW_SETPOINT_SPACING_US);
    take_at(last_us + MS(5));
    iw_setpoint_demand(&setpoint, last_us + MS(17), IW_DEMAND_FOLLOW);
    assert_only_due_from(last_us + MS(17));
}

TEST(test_setpoint_same_demand_again_does_not_move_the_pair) {
    static const iw_demand_t demands[] = {IW_DEMAND_ZERO, IW_DEMAND_BRAKE, IW_DEMAND_FOLLOW};
    for (size_t i = 0; i < sizeof demands / sizeof demands[0]; i++) {
        setUp();
        iw_setpoint_demand(&setpoint, FIXTURE_START_US, demands[i]);
        take_at(FIXTURE_START_US);
        for (uint32_t after_us = 0; after_us < 20000; after_us += 500) {
            iw_setpoint_demand(&setpoint, FIXTURE_START_US + after_us, demands[i]);
            TEST_ASSERT_FALSE(iw_setpoint_due(&setpoint, FIXTURE_START_US + after_us));
        }
        assert_only_due_from(FIXTURE_START_US + MS(20));
    }
}

TEST(test_setpoint_demand_zero_after_a_pair_is_due_immediately) {
    static const uint32_t after_us[] = {0, 1, 4999, 5000, 19999};
    for (size_t i = 0; i < sizeof after_us / sizeof after_us[0]; i++) {
        setUp();
        const iw_time_us_t last_us = cruise(FIXTURE_START_US, 1000, -800);
        iw_setpoint_demand(&setpoint, last_us + after_us[i], IW_DEMAND_ZERO);
        take_at(last_us + after_us[i]);
        TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
        TEST_ASSERT_FALSE(iw_setpoint_due(&setpoint, last_us + after_us[i]));
    }
}

TEST(test_setpoint_demand_silence_clears_all_immediately) {
    const iw_time_us_t last_us = cruise(FIXTURE_START_US, 1000, 1000);
    iw_setpoint_demand(&setpoint, last_us + MS(1), IW_DEMAND_SILENCE);
    assert_silent(last_us + MS(1));
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
    TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&setpoint));
    command_at(last_us + MS(2), 700, 700);
    assert_silent(last_us + MS(2));
    iw_setpoint_collapse(&setpoint, last_us + MS(3));
    assert_silent(last_us + MS(3));
}

TEST(test_setpoint_after_silence_has_no_old_command) {
    const iw_time_us_t last_us = cruise(FIXTURE_START_US, 1000, 1000);
    iw_setpoint_demand(&setpoint, last_us + MS(1), IW_DEMAND_SILENCE);
    iw_setpoint_demand(&setpoint, last_us + MS(300), IW_DEMAND_FOLLOW);
    take_at(last_us + MS(300));
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
    run_until(last_us + MS(2000));
    TEST_ASSERT_TRUE(iw_setpoint_is_zero(&setpoint));
}

TEST(test_setpoint_first_pair_after_a_short_silence_is_due) {
    iw_setpoint_demand(&setpoint, 1000, IW_DEMAND_FOLLOW);
    take_at(1000);
    iw_setpoint_demand(&setpoint, 2000, IW_DEMAND_SILENCE);
    iw_setpoint_demand(&setpoint, 3000, IW_DEMAND_FOLLOW);
    assert_only_due_from(3000);
}

TEST(test_setpoint_due_does_not_change_anything) {
    cruise(FIXTURE_START_US, 400, 400);
    const iw_setpoint_t before = setpoint;
    (void)iw_setpoint_due(&setpoint, before.last_us + MS(500));
    (void)iw_setpoint_next_us(&setpoint);
    (void)iw_setpoint_applied(&setpoint);
    (void)iw_setpoint_is_zero(&setpoint);
    TEST_ASSERT_EQUAL_MEMORY(&before, &setpoint, sizeof before);
}
