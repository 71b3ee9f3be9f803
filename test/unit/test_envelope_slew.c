// SPDX-License-Identifier: MIT
// Envelope and time: the permitted difference between a speed and the previous one.
#include "test_envelope_rig.h"

#include "unit.h"

/// A ramp in whole mm/s may be ahead of its slope by this value. The tests require a verdict outside this band only.
#define ROUNDING_MM_S 1

/// Brings the wheel to a speed as fast as the slope permits.
static void settle(iw_time_us_t now_us, iw_side_t side, int32_t speed_mm_s) {
    const int32_t step = config.accel_mm_s2 * (int32_t)(IW_ENVELOPE_ELAPSED_MAX_US / 1000U) / 1000;
    const int32_t direction = (speed_mm_s < 0) ? -1 : 1;
    iw_time_us_t past_us = AGES_US;
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(now_us - past_us, side, 0, 0));
    for (int32_t reached = step; reached < direction * speed_mm_s; reached += step) {
        past_us -= IW_ENVELOPE_ELAPSED_MAX_US;
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(now_us - past_us, side, direction * reached, 0));
    }
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(now_us, side, speed_mm_s, 0));
}

/// Returns the verdict on a change of speed in this time, with a new envelope.
static iw_envelope_verdict_t change(int32_t from_mm_s, int32_t to_mm_s, iw_time_us_t elapsed_us) {
    restart();
    settle(START_US, IW_LEFT, from_mm_s);
    return check(START_US + elapsed_us, IW_LEFT, to_mm_s, 0);
}

static const iw_time_us_t elapsed_list[] = {0,     1,     999,   1000,   4999,   5000,  19999,
                                            20000, 20001, 50000, 100000, 299999, 300000};
#define ELAPSED (sizeof elapsed_list / sizeof elapsed_list[0])

/// Checks both sides of the limit of a slope, forward and in reverse.
static void check_boundary(int32_t from_mm_s, int32_t direction, uint32_t slope_mm_s2, iw_time_us_t elapsed_us) {
    const int32_t allowed = (int32_t)(slope_mm_s2 * elapsed_us / 1000000U);
    const int32_t inside = from_mm_s + direction * allowed;
    const int32_t outside = from_mm_s + direction * (allowed + 1 + ROUNDING_MM_S);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(from_mm_s, inside, elapsed_us));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(-from_mm_s, -inside, elapsed_us));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(from_mm_s, outside, elapsed_us));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(-from_mm_s, -outside, elapsed_us));
}

TEST(test_envelope_away_from_zero_allows_the_acceleration_only) {
    static const uint16_t slopes[] = {50, 800, 799, 2500};
    config.decel_mm_s2 = 20000;
    config.max_speed_mm_s = 2000;
    for (size_t i = 0; i < 4 * ELAPSED; i++) {
        config.accel_mm_s2 = slopes[i / ELAPSED];
        check_boundary(600, 1, config.accel_mm_s2, elapsed_list[i % ELAPSED]);
    }
}

TEST(test_envelope_towards_zero_allows_the_deceleration_only) {
    static const uint16_t slopes[] = {100, 1500, 1501, 3333};
    static const uint16_t speeds[] = {70, 1100, 1101, 2500};
    config.accel_mm_s2 = 20000;
    for (size_t i = 0; i < 4 * ELAPSED; i++) {
        config.decel_mm_s2 = slopes[i / ELAPSED];
        config.max_speed_mm_s = speeds[i / ELAPSED];
        check_boundary(config.max_speed_mm_s, -1, config.decel_mm_s2, elapsed_list[i % ELAPSED]);
    }
}

TEST(test_envelope_from_zero_allows_the_acceleration_only) {
    for (size_t i = 0; i < ELAPSED; i++) {
        check_boundary(0, 1, 800, elapsed_list[i]);
    }
}

/// Runs a ramp of fractions, truncated to whole mm/s at each step, to full speed and back, in this direction.
static void run_ramp(int32_t direction, iw_time_us_t step_us) {
    iw_time_us_t now_us = START_US;
    uint64_t speed_um_s = 0;
    bool rising = true;
    restart();
    while (rising || speed_um_s > 0) {
        const uint64_t up_um_s = config.accel_mm_s2 * step_us / 1000U;
        const uint64_t down_um_s = config.decel_mm_s2 * step_us / 1000U;
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(now_us, IW_LEFT, direction * (int32_t)(speed_um_s / 1000U), 0));
        rising = rising && speed_um_s + up_um_s <= config.max_speed_mm_s * 1000U;
        speed_um_s = rising ? speed_um_s + up_um_s : (speed_um_s > down_um_s) ? speed_um_s - down_um_s : 0;
        now_us += step_us;
    }
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(now_us, IW_LEFT, 0, 0));
}

TEST(test_envelope_ramp_truncated_to_whole_mm_s_passes) {
    static const iw_time_us_t steps[] = {5000, 5001, 7777, 19999, 20000, 20013, 33333, 50000};
    config.accel_mm_s2 = 799;
    config.decel_mm_s2 = 1499;
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        run_ramp(1, steps[i]);
        run_ramp(-1, steps[i]);
    }
}

TEST(test_envelope_same_speed_without_delay_passes) {
    settle(START_US, IW_LEFT, 321);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US, IW_LEFT, 321, 0));
}

TEST(test_envelope_sign_change_is_stopped_until_a_zero) {
    static const int32_t speeds[] = {1, 2, 3, 10, 500, 1000};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        const int32_t speed = speeds[i];
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(speed, -speed, AGES_US));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(-speed, speed, AGES_US));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(speed, -1, AGES_US));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(-speed, 1, AGES_US));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(speed, 0, 0));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US + AGES_US, IW_LEFT, (speed > 240) ? -240 : -speed, 0));
    }
}

TEST(test_envelope_zero_passes_without_delay_from_every_speed) {
    for (int32_t speed = -1000; speed <= 1000; speed++) {
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(speed, 0, 0));
    }
}

TEST(test_envelope_ramp_after_a_zero_begins_at_zero) {
    settle(START_US, IW_LEFT, 1000);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US, IW_LEFT, 0, 2000));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(START_US + 20000, IW_LEFT, 1000, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(START_US + 20000, IW_LEFT, 16 + ROUNDING_MM_S + 1, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US + 20000, IW_LEFT, 16, 0));
}

TEST(test_envelope_zero_speed_with_any_current_limit_is_a_zero) {
    static const int32_t currents[] = {0, 1, 1999, 2000};
    for (size_t i = 0; i < sizeof currents / sizeof currents[0]; i++) {
        restart();
        settle(START_US, IW_LEFT, 1000);
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US, IW_LEFT, 0, currents[i]));
    }
}

TEST(test_envelope_zero_speed_with_current_setpoint_is_no_zero) {
    config.current_role = IW_ROLE_SETPOINT;
    restart();
    settle(START_US, IW_LEFT, 1000);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(START_US, IW_LEFT, 0, 1));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(START_US + 20000, IW_LEFT, 0, -2000));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US + 20000, IW_LEFT, 0, 0));
}

TEST(test_envelope_stopped_frame_is_not_stored) {
    static const struct {
        int32_t speed_mm_s;
        int32_t current_mA;
        iw_envelope_verdict_t verdict;
    } refused[] = {{0, 2001, IW_ENVELOPE_CURRENT},
                   {1001, 0, IW_ENVELOPE_SPEED},
                   {500, 0, IW_ENVELOPE_SLEW},
                   {-5, 0, IW_ENVELOPE_SLEW}};
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        restart();
        settle(START_US, IW_LEFT, 100);
        TEST_ASSERT_EQUAL_INT(refused[i].verdict,
                              check(START_US + 10000, IW_LEFT, refused[i].speed_mm_s, refused[i].current_mA));
        TEST_ASSERT_EQUAL_UINT32(1, envelope.stopped);
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(START_US + 20000, IW_LEFT, 116 + ROUNDING_MM_S + 1, 0));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US + 20000, IW_LEFT, 116, 0));
        TEST_ASSERT_EQUAL_UINT32(2, envelope.stopped);
    }
}

TEST(test_envelope_passed_frame_is_stored_with_its_time) {
    settle(START_US, IW_LEFT, 100);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US + 10000, IW_LEFT, 108, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(START_US + 20000, IW_LEFT, 116 + ROUNDING_MM_S + 1, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US + 20000, IW_LEFT, 116, 0));
}

TEST(test_envelope_wheels_have_separate_state) {
    settle(START_US, IW_LEFT, 1000);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US, IW_RIGHT, 0, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(START_US + 20000, IW_RIGHT, 1000, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US + 20000, IW_RIGHT, -16, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US + 20000, IW_LEFT, 1000, 0));
}

TEST(test_envelope_jump_after_silence_is_stopped) {
    static const iw_time_us_t silences[] = {300001, 1000000, AGES_US, (iw_time_us_t)1 << 50, (iw_time_us_t)1 << 62};
    for (size_t i = 0; i < sizeof silences / sizeof silences[0]; i++) {
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(0, 240 + ROUNDING_MM_S + 1, silences[i]));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(0, 240, silences[i]));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(1000, 550 - ROUNDING_MM_S - 1, silences[i]));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(1000, 550, silences[i]));
    }
}

TEST(test_envelope_steepest_slope_does_not_overflow) {
    config.accel_mm_s2 = 20000;
    config.decel_mm_s2 = 20000;
    config.max_speed_mm_s = 5000;
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(0, 5000, 300000));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(5000, 1, 300000));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, change(0, 5000, 250000));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, change(0, 5000, 249000));
}

TEST(test_envelope_first_frame_must_be_near_zero) {
    static const iw_time_us_t starts[] = {0, 1000, START_US, (iw_time_us_t)1 << 62};
    for (size_t i = 0; i < sizeof starts / sizeof starts[0]; i++) {
        restart();
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(starts[i], IW_LEFT, 1000, 0));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, check(starts[i], IW_RIGHT, -1000, 0));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(starts[i], IW_RIGHT, 0, 0));
    }
}
