// SPDX-License-Identifier: MIT
// Divergence of the wheel pair from its commanded path: what counts, what is tolerated, the limit, and the responsible
// wheel.
#include "fixture.h"
#include "iwheel/diverge.h"
#include "unit.h"

#include <stdlib.h>
#include <string.h>

/// At 192 mm, for rpm of the wheel
#define UM_S_PER_RPM 20106U
#define STEP_US      2000U

static iw_config_t config;
static iw_diverge_t pair;
static iw_time_us_t now_us;
static iw_diverge_verdict_t verdict;

static void begin(void) {
    memset(&pair, FIXTURE_POISON, sizeof pair);
    now_us = FIXTURE_START_US;
    iw_diverge_init(&pair, &config);
    iw_diverge_restart(&pair, now_us);
}

void setUp(void) {
    fixture_config(&config);
    begin();
}

typedef struct {
    int32_t left_mm_s;
    int32_t right_mm_s;
} speeds_t;

/// Applies and measures these speeds for this time. Ends early if the pair diverges. Returns the time in ms.
static uint32_t go_on(speeds_t applied, speeds_t measured, uint32_t for_ms) {
    const iw_time_us_t from_us = now_us;
    verdict = IW_DIVERGE_NOT;
    pair.applied_mm_s[IW_LEFT] = applied.left_mm_s;
    pair.applied_mm_s[IW_RIGHT] = applied.right_mm_s;
    iw_diverge_receive(&pair, IW_LEFT, measured.left_mm_s);
    iw_diverge_receive(&pair, IW_RIGHT, measured.right_mm_s);
    while (verdict == IW_DIVERGE_NOT && now_us < from_us + MS(for_ms)) {
        now_us += STEP_US;
        verdict = iw_diverge_step(&pair, now_us);
    }
    return (uint32_t)((now_us - from_us) / 1000U);
}

/// Both wheels follow their command: there is no deviation, and the expected speeds are settled.
static void settle(speeds_t speeds) {
    iw_diverge_receive(&pair, IW_LEFT, speeds.left_mm_s);
    iw_diverge_receive(&pair, IW_RIGHT, speeds.right_mm_s);
    pair.applied_mm_s[IW_LEFT] = speeds.left_mm_s;
    pair.applied_mm_s[IW_RIGHT] = speeds.right_mm_s;
    iw_diverge_restart(&pair, now_us);
    TEST_ASSERT_EQUAL_INT32(speeds.left_mm_s * 1000, pair.expected_um_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT32(speeds.right_mm_s * 1000, pair.expected_um_s[IW_RIGHT]);
}

/// The pair follows the applied speeds, then measures these.
static uint32_t drive(speeds_t applied, speeds_t measured, uint32_t for_ms) {
    settle(applied);
    return go_on(applied, measured, for_ms);
}

static void assert_drive(iw_diverge_verdict_t expected, speeds_t applied, speeds_t measured, uint32_t for_ms) {
    (void)drive(applied, measured, for_ms);
    TEST_ASSERT_EQUAL_INT(expected, verdict);
}

TEST(test_diverge_following_pair_has_no_deviation) {
    assert_drive(IW_DIVERGE_NOT, (speeds_t){800, -300}, (speeds_t){800, -300}, 10000U);
    TEST_ASSERT_EQUAL_INT32(0, pair.path_um);
    TEST_ASSERT_EQUAL_INT32(0, pair.largest_um);
}

TEST(test_diverge_expected_speed_follows_the_applied_with_the_lag) {
    pair.applied_mm_s[IW_LEFT] = 1000;
    pair.applied_mm_s[IW_RIGHT] = -1000;
    for (uint32_t i = 0; i < 30U; i++) {
        now_us += STEP_US;
        (void)iw_diverge_step(&pair, now_us);
    }
    TEST_ASSERT_INT32_WITHIN(4000, 632100, pair.expected_um_s[IW_LEFT]);
    TEST_ASSERT_INT32_WITHIN(4000, -632100, pair.expected_um_s[IW_RIGHT]);
}

TEST(test_diverge_expected_speed_is_equal_with_long_steps) {
    pair.applied_mm_s[IW_LEFT] = 1000;
    (void)iw_diverge_step(&pair, now_us + MS(20));
    (void)iw_diverge_step(&pair, now_us + MS(40));
    (void)iw_diverge_step(&pair, now_us + MS(60));
    TEST_ASSERT_INT32_WITHIN(8000, 632100, pair.expected_um_s[IW_LEFT]);
}

TEST(test_diverge_lag_is_configured) {
    config.wheel_lag_ms = 120;
    pair.applied_mm_s[IW_LEFT] = 1000;
    for (uint32_t i = 0; i < 60U; i++) {
        now_us += STEP_US;
        (void)iw_diverge_step(&pair, now_us);
    }
    TEST_ASSERT_INT32_WITHIN(4000, 632100, pair.expected_um_s[IW_LEFT]);
}

/// A wheel that does not turn counts double: 60 mm at 2000 mm/s need 30 ms, and a little more because of the leak.
TEST(test_diverge_blocked_wheel_is_slow_after_60_mm) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        begin();
        settle((speeds_t){1000, 1000});
        const speeds_t measured = {(side == IW_LEFT) ? 0 : 1000, (side == IW_LEFT) ? 1000 : 0};
        TEST_ASSERT_UINT32_WITHIN(3, 32, go_on((speeds_t){1000, 1000}, measured, 1000U));
        TEST_ASSERT_EQUAL_INT(IW_DIVERGE_SLOW, verdict);
        TEST_ASSERT_EQUAL_UINT8(side, pair.side);
        TEST_ASSERT_TRUE((side == IW_LEFT) ? pair.path_um >= 60000 : pair.path_um <= -60000);
    }
}

TEST(test_diverge_blocked_wheel_in_reverse_is_slow) {
    TEST_ASSERT_UINT32_WITHIN(3, 32, drive((speeds_t){-1000, -1000}, (speeds_t){0, -1000}, 1000U));
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_SLOW, verdict);
    TEST_ASSERT_EQUAL_UINT8(IW_LEFT, pair.side);
}

TEST(test_diverge_wheel_in_the_opposite_direction_is_slow) {
    assert_drive(IW_DIVERGE_SLOW, (speeds_t){400, 400}, (speeds_t){400, -400}, 1000U);
    TEST_ASSERT_EQUAL_UINT8(IW_RIGHT, pair.side);
}

TEST(test_diverge_compares_at_low_speed) {
    TEST_ASSERT_UINT32_WITHIN(10, 362, drive((speeds_t){99, 99}, (speeds_t){0, 99}, 3000U));
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_SLOW, verdict);
}

TEST(test_diverge_wheel_below_80_percent_is_slow_else_away) {
    assert_drive(IW_DIVERGE_AWAY, (speeds_t){1000, 1000}, (speeds_t){800, 1000}, 3000U);
    begin();
    assert_drive(IW_DIVERGE_SLOW, (speeds_t){1000, 1000}, (speeds_t){799, 1000}, 3000U);
}

/// Below a quarter of the expected speed the whole difference counts, and double.
TEST(test_diverge_wheel_below_25_percent_counts_double) {
    const uint32_t quarter_ms = drive((speeds_t){400, 400}, (speeds_t){400, 100}, 1000U);
    begin();
    const uint32_t below_ms = drive((speeds_t){400, 400}, (speeds_t){400, 99}, 1000U);
    TEST_ASSERT_UINT32_WITHIN(6, 252, quarter_ms);
    TEST_ASSERT_UINT32_WITHIN(4, 106, below_ms);
}

/// Below 50 mm/s one rpm is too coarse to detect a wheel that does not turn.
TEST(test_diverge_command_below_50_mm_s_counts_once) {
    assert_drive(IW_DIVERGE_NOT, (speeds_t){49, 49}, (speeds_t){49, 0}, 20000U);
    begin();
    assert_drive(IW_DIVERGE_SLOW, (speeds_t){50, 50}, (speeds_t){50, 0}, 20000U);
}

TEST(test_diverge_wheel_that_is_too_fast_is_away) {
    settle((speeds_t){1000, 1000});
    (void)go_on((speeds_t){500, 500}, (speeds_t){500, 1000}, 3000U);
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_AWAY, verdict);
    TEST_ASSERT_EQUAL_UINT8(IW_RIGHT, pair.side);
}

TEST(test_diverge_uncommanded_wheel_is_away_in_both_directions) {
    (void)go_on((speeds_t){0, 0}, (speeds_t){0, -300}, 3000U);
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_AWAY, verdict);
    TEST_ASSERT_EQUAL_UINT8(IW_RIGHT, pair.side);
    begin();
    (void)go_on((speeds_t){0, 0}, (speeds_t){300, 0}, 3000U);
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_AWAY, verdict);
    TEST_ASSERT_EQUAL_UINT8(IW_LEFT, pair.side);
}

TEST(test_diverge_droop_and_resolution_are_tolerated) {
    assert_drive(IW_DIVERGE_NOT, (speeds_t){1000, 1000}, (speeds_t){943, 1000}, 10000U);
    TEST_ASSERT_EQUAL_INT32(0, pair.path_um);
    (void)go_on((speeds_t){1000, 1000}, (speeds_t){935, 1000}, 10000U);
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_NOT, verdict);
    TEST_ASSERT_INT32_WITHIN(500, 7004, pair.path_um);
}

TEST(test_diverge_both_wheels_equally_slow_have_no_deviation) {
    assert_drive(IW_DIVERGE_NOT, (speeds_t){1000, 1000}, (speeds_t){0, 0}, 3000U);
    TEST_ASSERT_EQUAL_INT32(0, pair.path_um);
}

/// A difference that leaks as fast as it grows stays below the limit: 60 mm in 1000 ms.
TEST(test_diverge_steady_difference_below_the_leak_is_tolerated) {
    assert_drive(IW_DIVERGE_NOT, (speeds_t){500, 500}, (speeds_t){500, 595}, 20000U);
    TEST_ASSERT_GREATER_THAN_INT32(56000, pair.largest_um);
    (void)go_on((speeds_t){500, 500}, (speeds_t){500, 600}, 20000U);
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_AWAY, verdict);
}

TEST(test_diverge_leak_and_limit_are_configured) {
    config.pair_mm = 100;
    config.pair_leak_ms = 3000;
    const uint32_t took_ms = drive((speeds_t){500, 500}, (speeds_t){500, 600}, 20000U);
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_AWAY, verdict);
    TEST_ASSERT_UINT32_WITHIN(100, 2215, took_ms);
    TEST_ASSERT_INT32_WITHIN(200, 100000, pair.path_um);
}

TEST(test_diverge_restart_resets_the_deviation_not_the_largest) {
    (void)drive((speeds_t){1000, 1000}, (speeds_t){0, 1000}, 40U);
    TEST_ASSERT_GREATER_THAN_INT32(30000, pair.path_um);
    const int32_t largest_um = pair.largest_um;
    iw_diverge_restart(&pair, now_us);
    TEST_ASSERT_EQUAL_INT32(0, pair.path_um);
    TEST_ASSERT_EQUAL_INT32(largest_um, pair.largest_um);
    TEST_ASSERT_EQUAL_INT32(0, pair.expected_um_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT32(1000000, pair.expected_um_s[IW_RIGHT]);
}

TEST(test_diverge_begin_resets_only_for_a_new_drive) {
    iw_diverge_begin(&pair, 5000U);
    (void)drive((speeds_t){1000, 1000}, (speeds_t){0, 1000}, 40U);
    const int32_t path_um = pair.path_um;
    iw_diverge_begin(&pair, 5000U);
    TEST_ASSERT_EQUAL_INT32(path_um, pair.path_um);
    TEST_ASSERT_EQUAL_INT32(path_um, pair.largest_um);
    iw_diverge_begin(&pair, 6000U);
    TEST_ASSERT_EQUAL_INT32(0, pair.path_um);
    TEST_ASSERT_EQUAL_INT32(0, pair.largest_um);
}

TEST(test_diverge_steps_below_the_minimum_count_together) {
    settle((speeds_t){1000, 1000});
    iw_diverge_receive(&pair, IW_LEFT, 0);
    (void)iw_diverge_step(&pair, now_us + IW_DIVERGE_STEP_US - 1U);
    TEST_ASSERT_EQUAL_INT32(0, pair.path_um);
    (void)iw_diverge_step(&pair, now_us + IW_DIVERGE_STEP_US);
    TEST_ASSERT_INT32_WITHIN(20, 2014, pair.path_um);
}

TEST(test_diverge_long_pause_counts_as_50_ms) {
    settle((speeds_t){1000, 1000});
    iw_diverge_receive(&pair, IW_LEFT, 0);
    (void)iw_diverge_step(&pair, now_us + MS(5000));
    TEST_ASSERT_INT32_WITHIN(500, 100000, pair.path_um);
}

/// Exact figures, to which each constant of the calculation contributes.
TEST(test_diverge_one_step_equals_the_hand_calculation) {
    TEST_ASSERT_EQUAL_INT32(20106, pair.um_s_per_rpm);
    pair.applied_mm_s[IW_LEFT] = 1000;
    (void)iw_diverge_step(&pair, now_us + MS(40)); // Half of the way: 40 / (60 + 20)
    TEST_ASSERT_EQUAL_INT32(500000, pair.expected_um_s[IW_LEFT]);
    begin();
    config.wheel_lag_ms = 300;
    pair.applied_mm_s[IW_LEFT] = 1000;
    (void)iw_diverge_step(&pair, now_us + MS(100)); // Counts as 50 / (300 + 25)
    TEST_ASSERT_EQUAL_INT32(153839, pair.expected_um_s[IW_LEFT]);
    begin();
    config.wheel_lag_ms = 10;
    pair.applied_mm_s[IW_LEFT] = 1000;
    (void)iw_diverge_step(&pair, now_us + MS(50)); // The full way: 50 is more than 10 + 25.
    TEST_ASSERT_EQUAL_INT32(1000000, pair.expected_um_s[IW_LEFT]);
}

TEST(test_diverge_tolerance_is_4_percent_and_7_8_of_an_rpm) {
    settle((speeds_t){1000, 1000});
    iw_diverge_receive(&pair, IW_LEFT, 942); // 58000 um/s too slow: 408 more than 57592
    (void)iw_diverge_step(&pair, now_us + MS(50));
    TEST_ASSERT_EQUAL_INT32(20, pair.path_um);
    begin();
    settle((speeds_t){1000, 1000});
    iw_diverge_receive(&pair, IW_LEFT, 0);
    (void)iw_diverge_step(&pair, now_us + MS(50));
    TEST_ASSERT_EQUAL_INT32(100006, pair.path_um); // Double
}

TEST(test_diverge_limit_is_exact) {
    pair.path_um = 59999;
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_NOT, iw_diverge_step(&pair, now_us));
    pair.path_um = 60000;
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_AWAY, iw_diverge_step(&pair, now_us));
    pair.path_um = -59999;
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_NOT, iw_diverge_step(&pair, now_us));
    pair.path_um = -60000;
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_AWAY, iw_diverge_step(&pair, now_us));
}

TEST(test_diverge_limit_of_80_percent_is_exact) {
    settle((speeds_t){10000, 10000});
    pair.path_um = 60000;
    iw_diverge_receive(&pair, IW_LEFT, 7993);
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_SLOW, iw_diverge_step(&pair, now_us));
    iw_diverge_receive(&pair, IW_LEFT, 8000);
    TEST_ASSERT_EQUAL_INT(IW_DIVERGE_AWAY, iw_diverge_step(&pair, now_us));
}

TEST(test_diverge_largest_stays_while_the_deviation_leaks) {
    (void)drive((speeds_t){1000, 1000}, (speeds_t){500, 1000}, 60U);
    const int32_t largest_um = pair.largest_um;
    TEST_ASSERT_GREATER_THAN_INT32(20000, largest_um);
    (void)go_on((speeds_t){1000, 1000}, (speeds_t){1000, 1000}, 3000U);
    TEST_ASSERT_LESS_THAN_INT32(3000, pair.path_um);
    TEST_ASSERT_EQUAL_INT32(largest_um, pair.largest_um);
}

TEST(test_diverge_names_the_wheel_that_differs_more) {
    (void)drive((speeds_t){500, 500}, (speeds_t){420, 900}, 1000U);
    TEST_ASSERT_EQUAL_UINT8(IW_RIGHT, pair.side);
    begin();
    (void)drive((speeds_t){500, 500}, (speeds_t){900, 420}, 1000U);
    TEST_ASSERT_EQUAL_UINT8(IW_LEFT, pair.side);
    begin();
    (void)drive((speeds_t){500, 500}, (speeds_t){400, 600}, 1000U); // Equal differences: the right wheel
    TEST_ASSERT_EQUAL_UINT8(IW_RIGHT, pair.side);
}

TEST(test_diverge_measured_speed_is_clamped_to_40_m_s) {
    iw_diverge_receive(&pair, IW_LEFT, 40001);
    iw_diverge_receive(&pair, IW_RIGHT, -40001);
    iw_diverge_restart(&pair, now_us);
    TEST_ASSERT_EQUAL_INT32(40000000, pair.expected_um_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT32(-40000000, pair.expected_um_s[IW_RIGHT]);
    iw_diverge_receive(&pair, IW_LEFT, 39999);
    iw_diverge_restart(&pair, now_us);
    TEST_ASSERT_EQUAL_INT32(39999000, pair.expected_um_s[IW_LEFT]);
}

TEST(test_diverge_extreme_values_stay_within_bounds) {
    for (uint32_t i = 0; i < 2000U; i++) {
        now_us += MS(50);
        pair.applied_mm_s[IW_LEFT] = INT16_MIN;
        pair.applied_mm_s[IW_RIGHT] = INT16_MAX;
        iw_diverge_receive(&pair, IW_LEFT, 2000000);
        iw_diverge_receive(&pair, IW_RIGHT, -2000000);
        (void)iw_diverge_step(&pair, now_us);
        TEST_ASSERT_TRUE(abs(pair.path_um) <= 1000000);
        TEST_ASSERT_TRUE(abs(pair.expected_um_s[IW_LEFT]) <= 40000000);
    }
    TEST_ASSERT_EQUAL_INT32(-1000000, pair.path_um);
    TEST_ASSERT_EQUAL_INT32(1000000, pair.largest_um);
}

TEST(test_diverge_resolution_is_that_of_the_rotor_if_configured) {
    config.gear_turns = 5;
    config.gear_per = 4;
    iw_diverge_init(&pair, &config);
    TEST_ASSERT_EQUAL_INT32(UM_S_PER_RPM, pair.um_s_per_rpm);
    config.rpm_of_rotor = true;
    iw_diverge_init(&pair, &config);
    TEST_ASSERT_EQUAL_INT32(16084, pair.um_s_per_rpm); // 20106 x 4 / 5
}
