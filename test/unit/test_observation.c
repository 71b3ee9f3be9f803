// SPDX-License-Identifier: MIT
// Conclusions from the motion of the wheels, frame by frame: the tests build snapshots up to and beyond every limit.
#include "fixture.h"
#include "iwheel/gateway.h"
#include "iwheel/observation.h"

#include "unit.h"

#include <string.h>

/// 100 frames of 100 rpm with the longest interval that is no gap are 1000 ticks, so moved ticks are permille.
#define RPM      100
#define FRAMES   100U
#define FRAME_US ((iw_time_us_t)IW_OBSERVATION_GAP_US)
#define POSE_US  ((iw_time_us_t)2 * IW_OBSERVATION_GAP_US)
/// Ratio between the limits: it neither fits nor fails.
#define BETWEEN 1200
#define MISS    2000

static iw_config_t config;
static iw_gateway_t gateway;
static iw_codec_wheel_t telemetry[IW_SIDES];
static iw_observation_t observation;
static iw_snapshot_t seen;

static void begin_at(iw_time_us_t now_us) {
    const iw_hal_t hal = {0};
    memset(&gateway, FIXTURE_POISON, sizeof gateway);
    memset(&observation, FIXTURE_POISON, sizeof observation);
    memset(telemetry, 0, sizeof telemetry);
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_gateway_init(&gateway, &config, &hal, now_us, false));
    iw_gateway_snapshot(&gateway, now_us, &seen);
    seen.wheel[IW_LEFT].telemetry = &telemetry[IW_LEFT];
    seen.wheel[IW_RIGHT].telemetry = &telemetry[IW_RIGHT];
    iw_observation_init(&observation);
}

void setUp(void) {
    fixture_config(&config);
    begin_at(FIXTURE_START_US);
}

static void observe(void) {
    iw_observation_step(&observation, &gateway, &seen);
}

static void assert_entry(iw_assumption_item_t item, iw_assumption_state_t state, int32_t figure) {
    TEST_ASSERT_EQUAL_INT(state, seen.assumed[item].state);
    TEST_ASSERT_EQUAL_INT32(figure, seen.assumed[item].figure);
    TEST_ASSERT_EQUAL_INT((state == IW_ASSUMED) ? IW_SOURCE_NONE : IW_SOURCE_BUS, seen.assumed[item].source);
}

static void assert_ratio(iw_assumption_state_t state, int32_t figure) {
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, state, figure);
}

// ---- gear ratio ----

static void speed_of(iw_side_t side, int16_t rpm, iw_time_us_t after_us) {
    seen.at_us += after_us;
    seen.wheel[side].speed_us = seen.at_us;
    telemetry[side].speed.speed_rpm = rpm;
    observe();
}

static void speeds(int16_t rpm, unsigned frames) {
    for (unsigned i = 0; i < frames; i++) {
        speed_of(IW_LEFT, rpm, FRAME_US);
    }
}

static void status_of(iw_side_t side, int64_t moved) {
    seen.wheel[side].status_us = seen.at_us;
    seen.wheel[side].ticks += moved;
    observe();
}

static void begin_stretch(int16_t rpm) {
    seen.wheel[IW_LEFT].ticks = 1000000;
    speeds(rpm, 1);
    status_of(IW_LEFT, 0);
}

/// One stretch of 1000 ticks by the rpm; it ends with a status frame.
static void stretch(int64_t moved) {
    speeds(RPM, FRAMES);
    status_of(IW_LEFT, moved);
}

static void assert_after_one(int64_t moved, iw_assumption_state_t state) {
    begin_at(FIXTURE_START_US);
    begin_stretch(RPM);
    stretch(moved);
    assert_ratio(state, (state == IW_ASSUMED) ? 0 : (int32_t)moved);
}

static void assert_after_misses(int64_t moved, iw_assumption_state_t state, int32_t figure) {
    begin_at(FIXTURE_START_US);
    begin_stretch(RPM);
    for (unsigned i = 0; i < IW_OBSERVATION_MISSES; i++) {
        assert_ratio(IW_ASSUMED, 0);
        stretch(moved);
    }
    assert_ratio(state, figure);
}

TEST(test_observation_ratio_within_12_percent_fits) {
    assert_after_one(1000, IW_CONFIRMED);
    assert_after_one(1120, IW_CONFIRMED);
    assert_after_one(880, IW_CONFIRMED);
    assert_after_one(1121, IW_ASSUMED);
    assert_after_one(879, IW_ASSUMED);
}

TEST(test_observation_ratio_off_by_25_percent_fails_after_3_times) {
    assert_after_misses(1250, IW_ASSUMED, 0);
    assert_after_misses(750, IW_ASSUMED, 0);
    assert_after_misses(1251, IW_CONTRADICTED, 1251);
    assert_after_misses(749, IW_CONTRADICTED, 749);
    assert_after_misses(-1000, IW_CONTRADICTED, -1000);
}

TEST(test_observation_ratio_beyond_the_range_is_the_maximum) {
    assert_after_misses(INT32_MAX / 2 + 1000, IW_CONTRADICTED, INT32_MAX / 2 + 1000);
    assert_after_misses(INT32_MAX / 2 + 1001, IW_CONTRADICTED, INT32_MAX);
    assert_after_misses(-(INT32_MAX / 2) + 1000, IW_CONTRADICTED, -(INT32_MAX / 2) + 1000);
    assert_after_misses(-(INT32_MAX / 2) + 999, IW_CONTRADICTED, INT32_MAX);
    assert_after_misses(100000000000, IW_CONTRADICTED, INT32_MAX);
}

TEST(test_observation_ratio_between_the_limits_does_not_count) {
    begin_stretch(RPM);
    stretch(MISS);
    stretch(BETWEEN);
    stretch(MISS);
    assert_ratio(IW_ASSUMED, 0);
    stretch(MISS);
    assert_ratio(IW_CONTRADICTED, MISS);
}

TEST(test_observation_fit_between_misses_restarts_their_count) {
    begin_stretch(RPM);
    stretch(MISS);
    stretch(MISS);
    stretch(1000);
    stretch(MISS);
    stretch(MISS);
    assert_ratio(IW_CONFIRMED, 1000);
    stretch(MISS);
    assert_ratio(IW_CONTRADICTED, MISS);
}

TEST(test_observation_verdict_retains_its_first_figure) {
    begin_stretch(RPM);
    stretch(1000);
    stretch(1010);
    assert_ratio(IW_CONFIRMED, 1000);
    assert_after_misses(MISS, IW_CONTRADICTED, MISS);
    stretch(MISS + 1);
    assert_ratio(IW_CONTRADICTED, MISS);
}

TEST(test_observation_ticks_must_fall_when_driving_backwards) {
    begin_stretch(-RPM);
    speeds(-RPM, FRAMES);
    status_of(IW_LEFT, -1050);
    assert_ratio(IW_CONFIRMED, 1050);
}

TEST(test_observation_stretch_is_at_least_one_rotor_turn) {
    begin_stretch(10);
    speeds(10, 59);
    speed_of(IW_LEFT, 10, FRAME_US - 2U);
    speed_of(IW_LEFT, 28, 1U);
    status_of(IW_LEFT, 60); // One millionth of a tick is missing.
    assert_ratio(IW_ASSUMED, 0);
    speed_of(IW_LEFT, 28, 1U);
    status_of(IW_LEFT, 0);
    assert_ratio(IW_CONFIRMED, 1000);
}

TEST(test_observation_turns_between_two_frames_are_their_mean) {
    begin_stretch(RPM);
    for (unsigned i = 0; i < FRAMES; i++) {
        speed_of(IW_LEFT, (i % 2U == 0U) ? 3 * RPM : RPM, FRAME_US);
    }
    status_of(IW_LEFT, 2000);
    assert_ratio(IW_CONFIRMED, 1000);
}

static void assert_with_gear(uint16_t turns, uint16_t per, bool of_rotor, int64_t moved) {
    config.gear_turns = turns;
    config.gear_per = per;
    config.rpm_of_rotor = of_rotor;
    begin_at(FIXTURE_START_US);
    begin_stretch(RPM);
    stretch(moved);
    assert_ratio(IW_CONFIRMED, 1000);
}

TEST(test_observation_gear_applies_to_wheel_rpm_not_to_rotor_rpm) {
    assert_with_gear(5, 2, false, 2500);
    assert_with_gear(5, 2, true, 1000);
}

TEST(test_observation_each_wheel_has_its_own_stretch) {
    begin_stretch(RPM);
    speed_of(IW_RIGHT, RPM, 1000);
    status_of(IW_RIGHT, 0);
    for (unsigned i = 0; i < FRAMES; i++) {
        speed_of(IW_LEFT, RPM, FRAME_US / 2U);
        speed_of(IW_RIGHT, RPM, FRAME_US / 2U);
    }
    status_of(IW_RIGHT, 1030);
    assert_ratio(IW_CONFIRMED, 1030);
}

static void gap(void) {
    speed_of(IW_LEFT, RPM, FRAME_US + 1U);
}

static void slow_frame(void) {
    speeds(0, 1);
}

static void turn_back(void) {
    speeds(-RPM, 1);
}

static void reboot(void) {
    seen.wheel[IW_LEFT].reboots++;
}

static void reboot_unreported(void) {
    seen.wheel[IW_LEFT].reboots++;
    seen.wheel[IW_LEFT].status_us = IW_NEVER;
}

/// Neither the whole stretch nor the part after the break is judged; the next stretch is.
static void assert_breaks(void (*event)(void)) {
    for (int64_t moved = 500; moved <= 1000; moved += 500) {
        begin_at(FIXTURE_START_US);
        begin_stretch(RPM);
        speeds(RPM, FRAMES / 2U);
        event();
        speeds(RPM, FRAMES / 2U);
        status_of(IW_LEFT, moved);
        assert_ratio(IW_ASSUMED, 0);
        stretch(1000);
        assert_ratio(IW_CONFIRMED, 1000);
    }
}

TEST(test_observation_break_restarts_the_stretch) {
    assert_breaks(gap);
    assert_breaks(slow_frame);
    assert_breaks(turn_back);
    assert_breaks(reboot);
    assert_breaks(reboot_unreported);
}

TEST(test_observation_reboot_in_the_status_frame_judges_nothing) {
    begin_stretch(RPM);
    speeds(RPM, FRAMES);
    reboot();
    status_of(IW_LEFT, 1000);
    assert_ratio(IW_ASSUMED, 0);
}

TEST(test_observation_wheel_below_10_rpm_has_no_ratio) {
    begin_stretch(9);
    for (unsigned i = 0; i < FRAMES; i++) {
        speed_of(IW_LEFT, (i % 2U == 0U) ? 11 : 9, FRAME_US);
    }
    status_of(IW_LEFT, 100);
    assert_ratio(IW_ASSUMED, 0);
}

TEST(test_observation_same_snapshot_again_adds_nothing) {
    begin_stretch(12);
    for (unsigned i = 0; i < FRAMES; i++) {
        speed_of(IW_LEFT, (i % 2U == 0U) ? 9 : 12, FRAME_US);
        observe();
    }
    assert_ratio(IW_ASSUMED, 0);
    status_of(IW_LEFT, 105);
    assert_ratio(IW_CONFIRMED, 1000);
}

static void assert_endless(int64_t turned, iw_assumption_state_t state) {
    begin_at(FIXTURE_START_US);
    begin_stretch(RPM);
    observation.wheel[IW_LEFT].turned = turned;
    speeds(RPM, 1);
    status_of(IW_LEFT, 100010);
    TEST_ASSERT_EQUAL_INT(state, seen.assumed[IW_ASSUMPTION_GEAR_RATIO].state);
}

TEST(test_observation_stretch_without_status_ends_at_100000_ticks) {
    assert_endless(IW_OBSERVATION_TURNED_MAX, IW_CONFIRMED);
    assert_endless(IW_OBSERVATION_TURNED_MAX + 1, IW_ASSUMED);
    stretch(1000);
    assert_ratio(IW_CONFIRMED, 1000);
}

// ---- setpoint type ----

static void drive_side(iw_side_t side, int16_t applied_mm_s, int32_t measured_mm_s, iw_time_us_t for_us) {
    seen.state = IW_STATE_ARMED;
    seen.wheel[side].heard = true;
    seen.wheel[side].um_s_per_rpm = 20999;
    seen.wheel[side].speed_mm_s = measured_mm_s;
    seen.applied.wheel[side].speed_mm_s = applied_mm_s;
    observe();
    seen.at_us += for_us;
    observe();
}

static void assert_type(iw_assumption_state_t state, int32_t figure) {
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, state, figure);
}

static void assert_drive(int16_t applied_mm_s, int32_t measured_mm_s, bool confirms) {
    config.setpoint_type_set = false; // Otherwise the configuration is already stored as the source.
    begin_at(FIXTURE_START_US);
    drive_side(IW_LEFT, applied_mm_s, measured_mm_s, IW_OBSERVATION_TYPE_US);
    if (confirms) {
        assert_type(IW_CONFIRMED, measured_mm_s * 1000 / applied_mm_s);
    } else {
        assert_type(IW_ASSUMED, 0);
    }
}

TEST(test_observation_speed_within_15_percent_and_1_rpm_matches) {
    assert_drive(1000, 1171, true);
    assert_drive(1000, 1172, false);
    assert_drive(1000, 829, true);
    assert_drive(1000, 828, false);
    assert_drive(-1000, -1171, true);
    assert_drive(-1000, -1172, false);
    assert_drive(-1000, 1000, false);
}

TEST(test_observation_one_rpm_depends_on_the_wheel_radius) {
    assert_drive(1000, 1172, false);
    seen.wheel[IW_LEFT].um_s_per_rpm = 21000;
    observe();
    seen.at_us += IW_OBSERVATION_TYPE_US;
    observe();
    assert_type(IW_CONFIRMED, 1172);
}

TEST(test_observation_command_below_150_mm_s_has_no_type) {
    assert_drive(150, 150, true);
    assert_drive(-150, -150, true);
    assert_drive(149, 149, false);
    assert_drive(-149, -149, false);
}

static void assert_not_before_a_second(iw_side_t side) {
    config.setpoint_type_set = false;
    begin_at(FIXTURE_START_US);
    drive_side(side, 200, 210, IW_OBSERVATION_TYPE_US - 1U);
    assert_type(IW_ASSUMED, 0);
    seen.at_us += 1U;
    observe();
    assert_type(IW_CONFIRMED, 1050);
}

TEST(test_observation_either_wheel_confirms_the_type_after_1_s) {
    assert_not_before_a_second(IW_LEFT);
    assert_not_before_a_second(IW_RIGHT);
}

TEST(test_observation_type_needs_armed_state_and_telemetry) {
    assert_drive(200, 300, false);
    seen.wheel[IW_LEFT].speed_mm_s = 200;
    seen.state = IW_STATE_STOPPING;
    observe();
    seen.at_us += IW_OBSERVATION_TYPE_US;
    observe();
    assert_type(IW_ASSUMED, 0);
    seen.state = IW_STATE_ARMED;
    seen.wheel[IW_LEFT].heard = false;
    observe();
    seen.at_us += IW_OBSERVATION_TYPE_US;
    observe();
    assert_type(IW_ASSUMED, 0);
}

TEST(test_observation_new_command_restarts_the_second) {
    config.setpoint_type_set = false;
    begin_at(FIXTURE_START_US);
    for (int16_t mm_s = 200; mm_s < 300; mm_s = (int16_t)(mm_s + 10)) {
        drive_side(IW_LEFT, mm_s, mm_s, IW_OBSERVATION_TYPE_US - 1U);
        assert_type(IW_ASSUMED, 0);
    }
}

// ---- byte order of the pose ----

static void pose(int x_mm, int y_mm, int psi_mrad, iw_time_us_t after_us) {
    seen.at_us += after_us;
    seen.pose_us = seen.at_us;
    telemetry[IW_RIGHT].pose = (iw_codec_pose_t){(int16_t)x_mm, (int16_t)y_mm, 0, (int16_t)psi_mrad};
    observe();
}

/// Poses from the origin in steps of `step`, 2 * `step` and 3 * `step`.
static void walk(int step, int from, int to) {
    for (int i = from; i <= to; i++) {
        pose(step * i, step * 2 * i, step * 3 * i, POSE_US);
    }
}

static void assert_pose(iw_assumption_state_t state, int32_t figure) {
    assert_entry(IW_ASSUMPTION_POSE_BYTE_ORDER, state, figure);
}

TEST(test_observation_pose_in_small_steps_confirms_byte_order) {
    walk(1, 0, 24);
    assert_pose(IW_ASSUMED, 0);
    walk(1, 25, 25);
    assert_pose(IW_CONFIRMED, 256000);
}

TEST(test_observation_pose_in_large_steps_contradicts_byte_order) {
    walk(256, 0, 24);
    assert_pose(IW_ASSUMED, 0);
    walk(256, 25, 25);
    assert_pose(IW_CONTRADICTED, 3);
}

TEST(test_observation_undecided_pose_restarts_the_sums) {
    walk(257, 0, 25);
    for (int i = 1; i <= 25; i++) {
        assert_pose(IW_ASSUMED, 0);
        pose(257 * 25 + 256 * i, 257 * 50 + 512 * i, 257 * 75 + 768 * i, POSE_US);
    }
    assert_pose(IW_CONTRADICTED, 3);
}

TEST(test_observation_pose_is_judged_again_after_a_verdict) {
    walk(1, 0, 25);
    for (int i = 1; i <= 25; i++) {
        assert_pose(IW_CONFIRMED, 256000);
        pose(25 + 256 * i, 50 + 512 * i, 75 + 768 * i, POSE_US);
    }
    assert_pose(IW_CONTRADICTED, 3);
}

/// 25 steps to and fro whose sums are exactly 8192 and 65536: `low` and `lower` are 248 and 249, or both with swapped
/// bytes.
static void shuttle(int low, int lower) {
    for (int i = 0; i <= 25; i++) {
        pose(i % 2 * low, (i <= 8) ? i % 2 * lower : 0, 0, POSE_US);
    }
}

TEST(test_observation_pose_sums_must_differ_by_a_factor_of_8) {
    shuttle(248, 249);
    assert_pose(IW_CONFIRMED, 8000);
    seen.at_us += 1U; // After this gap the way back is no step.
    shuttle(-2048, -1792);
    assert_pose(IW_CONTRADICTED, 125);
}

TEST(test_observation_pose_wraps_in_the_shorter_direction) {
    for (int i = 0; i <= 25; i++) {
        pose(32767 - 10 + i, 0, 0, POSE_US);
    }
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, seen.assumed[IW_ASSUMPTION_POSE_BYTE_ORDER].state);
}

TEST(test_observation_unchanged_pose_is_no_step) {
    walk(1, 0, 24);
    pose(24, 48, 72, POSE_US);
    observe();
    assert_pose(IW_ASSUMED, 0);
    walk(1, 25, 25);
    assert_pose(IW_CONFIRMED, 256000);
}

TEST(test_observation_pose_after_a_gap_is_no_step) {
    walk(1, 0, 24);
    pose(25, 50, 75, POSE_US + 1U);
    assert_pose(IW_ASSUMED, 0);
    walk(1, 26, 26);
    assert_pose(IW_CONFIRMED, 256000);
}

TEST(test_observation_first_pose_at_clock_zero_is_no_step) {
    begin_at(0);
    pose(1, 0, 0, 100U);
    walk(1, 2, 25);
    assert_pose(IW_ASSUMED, 0);
}

TEST(test_observation_jumping_pose_is_judged_after_11_steps) {
    for (int i = 0; i <= 10; i++) {
        pose(i % 2 * INT16_MIN, i % 2 * INT16_MIN, i % 2 * INT16_MIN, POSE_US);
        assert_pose(IW_ASSUMED, 0);
    }
    pose(INT16_MIN, INT16_MIN, INT16_MIN, POSE_US);
    assert_pose(IW_CONTRADICTED, 3);
}

TEST(test_observation_pose_is_judged_at_the_limit_of_its_sum) {
    pose(0, 0, 0, POSE_US);
    observation.moved = IW_OBSERVATION_POSE_FAR - 257;
    pose(1, 0, 0, POSE_US);
    assert_pose(IW_ASSUMED, 0);
    begin_at(FIXTURE_START_US);
    pose(0, 0, 0, POSE_US);
    observation.moved = IW_OBSERVATION_POSE_FAR - 256;
    pose(1, 0, 0, POSE_US);
    assert_pose(IW_CONTRADICTED, 0);
}
