// SPDX-License-Identifier: MIT
// The pair as a machine: droop, slope, kerb, free wheel, late wheel, yaw inertia, truncated rpm, and the ranges of
// ordinary machines.
#include "sim_ranges.h"
#include "test_sim_rig.h"

#include "unit.h"

#include <stdlib.h>

void setUp(void) {
    rig_init();
    rig_run(START_US, BOOTED);
}

static sim_motion_t *motion(iw_side_t side) {
    return &pair.wheel[side].motion;
}

/// Drives both wheels from BOOTED on for `ms`; returns the end time.
static iw_time_us_t drive_for(int16_t left_mm_s, int16_t right_mm_s, uint32_t ms) {
    rig_drive(left_mm_s, right_mm_s);
    rig_run(BOOTED, BOOTED + ms * MS);
    return BOOTED + ms * MS;
}

TEST(test_machine_wheel_with_droop_settles_below_its_setpoint) {
    motion(IW_RIGHT)->droop_permille = 40U;
    (void)drive_for(1000, 1000, 2000U);
    TEST_ASSERT_INT32_WITHIN(1, 1000, sim_motion_true_mm_s(motion(IW_LEFT)));
    TEST_ASSERT_INT32_WITHIN(1, 960, sim_motion_true_mm_s(motion(IW_RIGHT)));
}

TEST(test_machine_free_wheel_coasts_despite_commands) {
    iw_time_us_t const now_us = drive_for(1000, 1000, 2000U);
    motion(IW_RIGHT)->freewheels = true;
    rig_run(now_us, now_us + 500U * MS);
    TEST_ASSERT_INT32_WITHIN(1, 1000, sim_motion_true_mm_s(motion(IW_LEFT)));
    TEST_ASSERT_INT32_WITHIN(5, 650, sim_motion_true_mm_s(motion(IW_RIGHT)));
}

TEST(test_machine_kerb_reduces_the_speed_and_ends_immediately) {
    iw_time_us_t const now_us = drive_for(1000, 1000, 2000U);
    int64_t const before_mm = sim_motion_true_mm(motion(IW_LEFT));
    motion(IW_LEFT)->kerb_permille = 500U;
    rig_run(now_us, now_us + 100U * MS);
    TEST_ASSERT_INT32_WITHIN(1, 500, sim_motion_true_mm_s(motion(IW_LEFT)));
    TEST_ASSERT_INT64_WITHIN(500, 24868, sim_motion_milli_rpm(motion(IW_LEFT)));
    TEST_ASSERT_INT64_WITHIN(2, before_mm + 50, sim_motion_true_mm(motion(IW_LEFT)));
    motion(IW_LEFT)->kerb_permille = 0U;
    TEST_ASSERT_INT32_WITHIN(1, 1000, sim_motion_true_mm_s(motion(IW_LEFT)));
}

TEST(test_machine_slope_is_held_by_the_motor_only) {
    motion(IW_LEFT)->slope_mm_s2 = 1500;
    motion(IW_RIGHT)->slope_mm_s2 = 1500;
    motion(IW_RIGHT)->freewheels = true;
    (void)drive_for(0, 0, 1000U);
    TEST_ASSERT_EQUAL_INT32(0, motion(IW_LEFT)->speed_um_s);
    TEST_ASSERT_INT32_WITHIN(10, 800, sim_motion_true_mm_s(motion(IW_RIGHT)));
}

TEST(test_machine_slope_within_friction_moves_no_wheel) {
    motion(IW_LEFT)->slope_mm_s2 = 690;
    rig_run(BOOTED, BOOTED + SECOND);
    TEST_ASSERT_EQUAL_INT32(0, motion(IW_LEFT)->speed_um_s);
}

TEST(test_machine_slope_steeper_than_the_torque_moves_the_wheel) {
    motion(IW_LEFT)->slope_mm_s2 = -4500;
    (void)drive_for(500, 500, 500U);
    TEST_ASSERT_LESS_OR_EQUAL_INT32(0, motion(IW_LEFT)->speed_um_s);
}

TEST(test_machine_late_wheel_follows_each_setpoint_later) {
    pair.wheel[IW_RIGHT].late_us = 400U * MS;
    iw_time_us_t const now_us = drive_for(300, 300, 390U);
    TEST_ASSERT_GREATER_THAN_INT32(250, sim_motion_true_mm_s(motion(IW_LEFT)));
    TEST_ASSERT_EQUAL_INT32(0, motion(IW_RIGHT)->speed_um_s);
    rig_run(now_us, now_us + 400U * MS);
    TEST_ASSERT_GREATER_THAN_INT32(250, sim_motion_true_mm_s(motion(IW_RIGHT)));
    rig_drive(0, 0);
    rig_run(now_us + 400U * MS, now_us + 790U * MS);
    TEST_ASSERT_EQUAL_INT32(0, motion(IW_LEFT)->speed_um_s);
    TEST_ASSERT_GREATER_THAN_INT32(250, sim_motion_true_mm_s(motion(IW_RIGHT)));
    pair.wheel[IW_RIGHT].late_us = 0U;
    rig_run(now_us + 790U * MS, now_us + 2000U * MS);
    TEST_ASSERT_EQUAL_INT32(0, motion(IW_RIGHT)->speed_um_s);
}

TEST(test_machine_late_wheel_drops_its_setpoints_at_a_reboot) {
    pair.wheel[IW_RIGHT].late_us = 400U * MS;
    iw_time_us_t const now_us = drive_for(300, 300, 300U);
    rig_let_go();
    sim_pair_reboot(&pair, now_us, IW_RIGHT);
    rig_run(now_us, now_us + 1000U * MS);
    TEST_ASSERT_EQUAL_UINT32(0U, motion(IW_RIGHT)->setpoints);
}

TEST(test_machine_late_wheel_stores_a_limited_number) {
    iw_codec_setpoint_t const setpoint = {100, 2000, 1U};
    pair.wheel[IW_LEFT].late_us = 400U * MS;
    for (uint32_t i = 0U; i < SIM_WHEEL_LATE_MAX + 10U; i++) {
        sim_wheel_receive(&pair.wheel[IW_LEFT], BOOTED + i, &setpoint);
    }
    TEST_ASSERT_EQUAL_UINT32(SIM_WHEEL_LATE_MAX, pair.wheel[IW_LEFT].late_count);
}

/// Returns the speed of both wheels 60 ms after a command, with this share of yaw inertia.
static void speeds_after_60_ms(int16_t yaw_permille, int16_t left_mm_s, int16_t right_mm_s,
                               int32_t out_mm_s[IW_SIDES]) {
    rig_init();
    rig_run(START_US, BOOTED);
    motion(IW_LEFT)->config.yaw_permille = yaw_permille;
    motion(IW_RIGHT)->config.yaw_permille = yaw_permille;
    (void)drive_for(left_mm_s, right_mm_s, 60U);
    out_mm_s[IW_LEFT] = sim_motion_true_mm_s(motion(IW_LEFT));
    out_mm_s[IW_RIGHT] = sim_motion_true_mm_s(motion(IW_RIGHT));
}

TEST(test_machine_yaw_inertia_slows_turning_only) {
    int32_t without[IW_SIDES];
    int32_t with[IW_SIDES];
    speeds_after_60_ms(0, 100, 100, without);
    speeds_after_60_ms(300, 100, 100, with);
    TEST_ASSERT_INT32_WITHIN(3, without[IW_LEFT], with[IW_LEFT]);
    TEST_ASSERT_INT32_WITHIN(3, without[IW_RIGHT], with[IW_RIGHT]);
    speeds_after_60_ms(0, -100, 100, without);
    speeds_after_60_ms(300, -100, 100, with);
    TEST_ASSERT_LESS_THAN_INT32(without[IW_RIGHT] - 10, with[IW_RIGHT]);
    TEST_ASSERT_GREATER_THAN_INT32(without[IW_LEFT] + 10, with[IW_LEFT]);
}

TEST(test_machine_yaw_inertia_moves_the_other_wheel) {
    int32_t with[IW_SIDES];
    speeds_after_60_ms(300, 0, 500, with);
    TEST_ASSERT_GREATER_THAN_INT32(5, with[IW_LEFT]);
}

TEST(test_machine_truncated_rpm_never_exceed_the_true_speed) {
    pair.wheel[IW_LEFT].truncates = true;
    pair.wheel[IW_RIGHT].truncates = true;
    iw_time_us_t now_us = drive_for(993, -993, 2000U); // The speed is 49.4 rpm.
    for (unsigned i = 0U; i < 200U; i++) {
        rig_run(now_us, now_us + 4U * MS);
        now_us += 4U * MS;
        TEST_ASSERT_EQUAL_INT16(49, rig_last(IW_ID_LEFT_SPEED).as.speed.speed_rpm);
        TEST_ASSERT_EQUAL_INT16(-49, rig_last(IW_ID_RIGHT_SPEED).as.speed.speed_rpm);
    }
}

/// Returns true if the value is between the limits, both included.
static bool within(int64_t value, int64_t low, int64_t high) {
    return value >= low && value <= high;
}

TEST(test_ranges_machine_is_within_and_reaches_both_ends) {
    sim_random_t random;
    uint32_t shortest_us = UINT32_MAX;
    uint32_t longest_us = 0U;
    sim_random_init(&random, 1U);
    for (unsigned i = 0U; i < 1000U; i++) {
        sim_ranges_machine(&config, &random);
        for (unsigned side = 0U; side < IW_SIDES; side++) {
            sim_motion_config_t const *const drawn = &config.wheel[side].motion;
            TEST_ASSERT_TRUE(within(drawn->response_us, SIM_RANGE_LAG_MIN_US, SIM_RANGE_LAG_MAX_US));
            TEST_ASSERT_TRUE(within(drawn->radius_mm, SIM_RANGE_RADIUS_MIN_MM, SIM_RANGE_RADIUS_MAX_MM));
            TEST_ASSERT_TRUE(within(drawn->accel_mm_s2, SIM_RANGE_ACCEL_MIN_MM_S2, SIM_RANGE_ACCEL_MAX_MM_S2));
            TEST_ASSERT_TRUE(within(drawn->coast_mm_s2, SIM_RANGE_COAST_MIN_MM_S2, SIM_RANGE_COAST_MAX_MM_S2));
            TEST_ASSERT_TRUE(within(drawn->yaw_permille, -SIM_RANGE_YAW_MAX_PERMILLE, SIM_RANGE_YAW_MAX_PERMILLE));
            shortest_us = (drawn->response_us < shortest_us) ? drawn->response_us : shortest_us;
            longest_us = (drawn->response_us > longest_us) ? drawn->response_us : longest_us;
        }
        TEST_ASSERT_EQUAL_INT16(config.wheel[IW_LEFT].motion.yaw_permille, config.wheel[IW_RIGHT].motion.yaw_permille);
    }
    TEST_ASSERT_EQUAL_UINT32(SIM_RANGE_LAG_MIN_US, shortest_us);
    TEST_ASSERT_EQUAL_UINT32(SIM_RANGE_LAG_MAX_US, longest_us);
}

TEST(test_ranges_road_is_within_and_slopes_both_wheels_equally) {
    sim_random_t random;
    sim_random_init(&random, 2U);
    pair.pose.mirrored[IW_RIGHT] = true;
    for (unsigned i = 0U; i < 1000U; i++) {
        sim_ranges_road(&pair, BOOTED, &random);
        TEST_ASSERT_TRUE(abs(motion(IW_LEFT)->slope_mm_s2) <= SIM_RANGE_SLOPE_MAX_MM_S2);
        TEST_ASSERT_EQUAL_INT32(motion(IW_LEFT)->slope_mm_s2, -motion(IW_RIGHT)->slope_mm_s2);
        for (unsigned side = 0U; side < IW_SIDES; side++) {
            TEST_ASSERT_TRUE(pair.wheel[side].loss_permille <= SIM_RANGE_LOSS_MAX_PERMILLE);
            TEST_ASSERT_TRUE(motion((iw_side_t)side)->droop_permille <= SIM_RANGE_DROOP_MAX_PERMILLE);
        }
    }
}

TEST(test_ranges_kerb_is_under_one_wheel_and_ends_in_time) {
    sim_random_t random;
    sim_random_init(&random, 3U);
    for (unsigned i = 0U; i < 200U; i++) {
        iw_time_us_t const end_us = sim_ranges_kerb(&pair, BOOTED, &random);
        unsigned const left = motion(IW_LEFT)->kerb_permille;
        unsigned const right = motion(IW_RIGHT)->kerb_permille;
        TEST_ASSERT_TRUE(left == 0U || right == 0U);
        TEST_ASSERT_TRUE(left + right <= SIM_RANGE_KERB_MAX_PERMILLE);
        TEST_ASSERT_TRUE(end_us > BOOTED && end_us <= BOOTED + SIM_RANGE_KERB_MAX_US);
        sim_ranges_kerb_ends(&pair, BOOTED);
        TEST_ASSERT_EQUAL_UINT16(0U, motion(IW_LEFT)->kerb_permille);
        TEST_ASSERT_EQUAL_UINT16(0U, motion(IW_RIGHT)->kerb_permille);
    }
}
