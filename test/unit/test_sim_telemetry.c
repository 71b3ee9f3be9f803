// SPDX-License-Identifier: MIT
// Contents of the frames of the simulated pair.
#include "test_sim_rig.h"

#include "unit.h"

void setUp(void) {
    rig_init();
}

TEST(test_sim_pair_learns_its_sensor_zero_without_load) {
    rig_run(START_US, START_US + 4U * SECOND);
    TEST_ASSERT_INT_WITHIN(1, 123, rig_last(513U).as.offset.offset_dN);
    TEST_ASSERT_INT_WITHIN(1, 98, rig_last(545U).as.offset.offset_dN);
    TEST_ASSERT_INT_WITHIN(30, 1230, rig_last(512U).as.force.force_raw);
    TEST_ASSERT_INT_WITHIN(3, 98, rig_last(544U).as.force.force_raw);
}

TEST(test_sim_pair_load_at_the_start_changes_the_offset) {
    pair.wheel[IW_RIGHT].force.load_mN = 200000;
    rig_run(START_US, START_US + 4U * SECOND);
    pair.wheel[IW_RIGHT].force.load_mN = 0;
    rig_run(START_US + 4U * SECOND, START_US + 6U * SECOND);
    TEST_ASSERT_INT_WITHIN(100, 2098, rig_last(545U).as.offset.offset_dN);
    TEST_ASSERT_INT_WITHIN(3, 98, rig_last(544U).as.force.force_raw);
    TEST_ASSERT_INT_WITHIN(1, 123, rig_last(513U).as.offset.offset_dN);
}

TEST(test_sim_pair_load_after_2_s_does_not_change_the_offset) {
    rig_run(START_US, START_US + 3U * SECOND);
    pair.wheel[IW_LEFT].force.load_mN = 100000;
    rig_run(START_US + 3U * SECOND, START_US + 8U * SECOND);
    TEST_ASSERT_INT_WITHIN(1, 123, rig_last(513U).as.offset.offset_dN);
    TEST_ASSERT_INT_WITHIN(600, 1230 + 10000, rig_last(512U).as.force.force_raw);
}

TEST(test_sim_pair_load_varies_by_5_percent_at_0_7_hertz) {
    int32_t low = INT32_MAX;
    int32_t high = INT32_MIN;
    unsigned rising = 0U;
    bool above = false;
    pair.wheel[IW_LEFT].force.noise_mN = 0;
    rig_run(START_US, START_US + 3U * SECOND);
    pair.wheel[IW_LEFT].force.load_mN = 100000;
    for (iw_time_us_t now_us = START_US + 4U * SECOND; now_us < START_US + 14U * SECOND; now_us += 50U * MS) {
        rig_run(now_us, now_us);
        int32_t const raw = rig_last(512U).as.force.force_raw;
        low = (raw < low) ? raw : low;
        high = (raw > high) ? raw : high;
        rising += (!above && raw > 11330) ? 1U : 0U;
        above = (raw > 11330) || (above && raw > 11130);
    }
    TEST_ASSERT_INT_WITHIN(10, 10730, low);
    TEST_ASSERT_INT_WITHIN(10, 11730, high);
    TEST_ASSERT_UINT32_WITHIN(1U, 7U, rising);
}

TEST(test_sim_pair_force_unit_is_per_wheel_and_offset_is_in_dN) {
    pair.wheel[IW_LEFT].force.unit = IW_FORCE_DN;
    pair.wheel[IW_RIGHT].force.unit = IW_FORCE_CN;
    rig_run(START_US, START_US + 4U * SECOND);
    TEST_ASSERT_INT_WITHIN(3, 123, rig_last(512U).as.force.force_raw);
    TEST_ASSERT_INT_WITHIN(30, 980, rig_last(544U).as.force.force_raw);
    TEST_ASSERT_INT_WITHIN(1, 123, rig_last(513U).as.offset.offset_dN);
    TEST_ASSERT_INT_WITHIN(1, 98, rig_last(545U).as.offset.offset_dN);
}

TEST(test_sim_pair_with_zero_removed_sends_its_offset) {
    pair.wheel[IW_LEFT].force.zero_removed = true;
    rig_run(START_US, START_US + 4U * SECOND);
    TEST_ASSERT_INT_WITHIN(30, 0, rig_last(512U).as.force.force_raw);
    TEST_ASSERT_INT_WITHIN(1, 123, rig_last(513U).as.offset.offset_dN);
}

TEST(test_sim_pair_force_saturates_or_has_a_set_raw_value) {
    pair.wheel[IW_LEFT].force.load_mN = 4000000;
    pair.wheel[IW_RIGHT].force.load_mN = -4000000;
    rig_run(START_US, START_US + 1U * SECOND);
    TEST_ASSERT_EQUAL_INT(INT16_MAX, rig_last(512U).as.force.force_raw);
    TEST_ASSERT_EQUAL_INT(INT16_MIN, rig_last(544U).as.force.force_raw);
    pair.wheel[IW_LEFT].force.forced_raw = -32768;
    rig_run(START_US + 1U * SECOND, START_US + 2U * SECOND);
    TEST_ASSERT_EQUAL_INT(-32768, rig_last(512U).as.force.force_raw);
}

TEST(test_sim_pair_speed_frames_have_no_bias) {
    int64_t sum = 0;
    rig_drive(500, -300);
    rig_run(START_US, START_US + 3U * SECOND);
    for (unsigned i = 0U; i < 1000U; i++) {
        iw_time_us_t const now_us = START_US + 3U * SECOND + i * 4U * MS;
        rig_run(now_us, now_us + 4U * MS);
        sum += rig_last(256U).as.speed.speed_rpm;
        TEST_ASSERT_INT_WITHIN(1, -15, rig_last(288U).as.speed.speed_rpm);
    }
    TEST_ASSERT_INT64_WITHIN(100, 24868, sum);
}

TEST(test_sim_pair_at_standstill_sends_exactly_zero_rpm) {
    rig_drive(0, 0);
    rig_run(START_US, START_US + 3U * SECOND);
    TEST_ASSERT_EQUAL_INT(0, rig_last(256U).as.speed.speed_rpm);
    TEST_ASSERT_EQUAL_INT(0, rig_last(288U).as.speed.speed_rpm);
    TEST_ASSERT_EQUAL_INT(0, rig_last(256U).as.speed.acceleration_raw);
}

TEST(test_sim_pair_swapped_sign_negates_rpm_and_ticks) {
    pair.wheel[IW_RIGHT].motion.swapped = true;
    rig_drive(500, 500);
    rig_run(START_US, START_US + 4U * SECOND);
    TEST_ASSERT_INT_WITHIN(1, 25, rig_last(256U).as.speed.speed_rpm);
    TEST_ASSERT_INT_WITHIN(1, -25, rig_last(288U).as.speed.speed_rpm);
    TEST_ASSERT_GREATER_THAN_INT32(60, rig_last(257U).as.status.odometry_ticks);
    TEST_ASSERT_LESS_THAN_INT32(-60, rig_last(289U).as.status.odometry_ticks);
}

TEST(test_sim_pair_ticks_wrap_at_the_end_of_int32) {
    rig_run(START_US, BOOTED);
    pair.wheel[IW_LEFT].motion.ticks = INT32_MAX;
    rig_drive(500, 500);
    rig_run(BOOTED, BOOTED + 2U * SECOND);
    TEST_ASSERT_LESS_THAN_INT32(INT32_MIN + 100, rig_last(257U).as.status.odometry_ticks);
    TEST_ASSERT_GREATER_THAN_INT32(INT32_MIN + 20, rig_last(257U).as.status.odometry_ticks);
}

TEST(test_sim_pair_straight_drive_has_a_straight_pose) {
    rig_run(START_US, BOOTED);
    rig_drive(500, 500);
    rig_run(BOOTED, START_US + 10U * SECOND);
    iw_codec_pose_t const pose = rig_last(290U).as.pose;
    int64_t const way_mm = pair.wheel[IW_RIGHT].motion.position_nm / 1000000;
    TEST_ASSERT_INT64_WITHIN(15, way_mm, pose.x_mm);
    TEST_ASSERT_INT_WITHIN(60, 0, pose.y_mm);
    TEST_ASSERT_INT_WITHIN(12, 0, pose.psi_mrad);
    TEST_ASSERT_EQUAL_INT(0, pose.z_mm);
}

TEST(test_sim_pair_turn_on_the_spot_turns_by_distance_over_track) {
    rig_run(START_US, BOOTED);
    rig_drive(-200, 200);
    rig_run(BOOTED, START_US + 6U * SECOND);
    iw_codec_pose_t const pose = rig_last(290U).as.pose;
    int64_t const way_um = (pair.wheel[IW_RIGHT].motion.position_nm - pair.wheel[IW_LEFT].motion.position_nm) / 1000;
    TEST_ASSERT_INT64_WITHIN(40, way_um / 540, pose.psi_mrad);
    TEST_ASSERT_INT_WITHIN(15, 0, pose.x_mm);
    TEST_ASSERT_INT_WITHIN(15, 0, pose.y_mm);
}

TEST(test_sim_pair_curve_to_the_left_has_positive_y_and_psi) {
    rig_drive(250, 350);
    rig_run(START_US, START_US + 5U * SECOND);
    TEST_ASSERT_GREATER_THAN_INT16(500, rig_last(290U).as.pose.y_mm);
    TEST_ASSERT_GREATER_THAN_INT16(600, rig_last(290U).as.pose.psi_mrad);
}

TEST(test_sim_pair_pose_needs_the_left_wheel_on_the_bus) {
    pair.wheel[IW_LEFT].muted = true;
    rig_drive(300, 300);
    rig_run(START_US, START_US + 4U * SECOND);
    TEST_ASSERT_GREATER_THAN_INT16(1500, rig_last(290U).as.pose.psi_mrad);
}

TEST(test_sim_pair_mirrored_wheel_is_negated_in_the_pose) {
    config.mirrored[IW_RIGHT] = true;
    sim_pair_init(&pair, &config, START_US, 1U);
    rig_run(START_US, BOOTED);
    rig_drive(400, -400);
    rig_run(BOOTED, START_US + 5U * SECOND);
    TEST_ASSERT_GREATER_THAN_INT16(1500, rig_last(290U).as.pose.x_mm);
    TEST_ASSERT_INT_WITHIN(15, 0, rig_last(290U).as.pose.psi_mrad);
}

TEST(test_sim_pair_pose_saturates_in_x_and_wraps_in_psi) {
    rig_run(START_US, BOOTED);
    pair.pose.x_nm = INT64_C(40000000000);
    pair.pose.y_nm = INT64_C(-40000000000);
    pair.pose.psi_nrad = INT64_C(33000000000);
    rig_run(BOOTED, BOOTED + 100U * MS);
    TEST_ASSERT_EQUAL_INT(32767, rig_last(290U).as.pose.x_mm);
    TEST_ASSERT_EQUAL_INT(-32768, rig_last(290U).as.pose.y_mm);
    TEST_ASSERT_EQUAL_INT(33000 - 65536, rig_last(290U).as.pose.psi_mrad);
}

TEST(test_sim_pair_battery_drops_and_temperature_rises_under_load) {
    rig_run(START_US, START_US + 2U * SECOND);
    TEST_ASSERT_EQUAL_UINT8(248U, rig_last(257U).as.status.battery_dV);
    TEST_ASSERT_EQUAL_UINT8(28U, rig_last(257U).as.status.temperature_degC);
    TEST_ASSERT_UINT8_WITHIN(4U, 22U, rig_last(257U).as.status.cpu_percent);
    pair.wheel[IW_LEFT].motion.blocked = true;
    pair.wheel[IW_RIGHT].motion.blocked = true;
    rig_drive(500, 500);
    rig_run(START_US + 2U * SECOND, START_US + 302U * SECOND);
    TEST_ASSERT_EQUAL_UINT8(240U, rig_last(257U).as.status.battery_dV);
    TEST_ASSERT_UINT8_WITHIN(8U, 60U, rig_last(257U).as.status.temperature_degC);
}

TEST(test_sim_pair_reboot_learns_the_offset_again) {
    rig_run(START_US, START_US + 4U * SECOND);
    pair.wheel[IW_LEFT].force.sensor_zero_mN = -50000;
    sim_pair_reboot(&pair, START_US + 4U * SECOND, IW_LEFT);
    rig_run(START_US + 4U * SECOND, START_US + 8U * SECOND);
    TEST_ASSERT_INT_WITHIN(1, -500, rig_last(513U).as.offset.offset_dN);
}

TEST(test_sim_pair_offset_is_the_mean_of_two_seconds) {
    pair.wheel[IW_LEFT].force.noise_mN = 0;
    rig_run(START_US, BOOTED + 900U * MS);
    pair.wheel[IW_LEFT].force.sensor_zero_mN = 52300;
    rig_run(BOOTED + 900U * MS, START_US + 4U * SECOND);
    TEST_ASSERT_INT_WITHIN(12, 323, rig_last(513U).as.offset.offset_dN);
}

TEST(test_sim_pair_muted_left_wheel_counts_as_standstill_in_pose) {
    rig_run(START_US, BOOTED);
    rig_drive(300, 300);
    rig_run(BOOTED, BOOTED + 2U * SECOND);
    pair.wheel[IW_LEFT].muted = true;
    int16_t const before_mrad = rig_last(290U).as.pose.psi_mrad;
    rig_run(BOOTED + 2U * SECOND, BOOTED + 3U * SECOND);
    TEST_ASSERT_INT_WITHIN(40, 300 * 950 / 540, rig_last(290U).as.pose.psi_mrad - before_mrad);
}
