// SPDX-License-Identifier: MIT
// Distance and speed of a wheel: unwrapping, jumps, geometry, mirrored wheels.
#include "fixture.h"
#include "iwheel/private/wheel.h"
#include "message.h"
#include "unit.h"
#include <string.h>

static iw_config_t config;
static iw_wheel_t wheel;
static iw_time_us_t now_us;

static void begin_side(iw_side_t side) {
    now_us = FIXTURE_START_US;
    memset(&wheel, FIXTURE_POISON, sizeof wheel);
    iw_wheel_init(&wheel, &config, side, now_us);
}

void setUp(void) {
    fixture_config(&config);
    begin_side(IW_LEFT);
}

static void receive_ticks(int32_t ticks) {
    const message_t message = {IW_CODEC_STATUS, wheel.side, {.status = {ticks, 255, 30, 20}}};
    now_us += MS(40);
    iw_wheel_receive(&wheel, now_us, message.kind, &message.as, true);
}

static void receive_speed(int16_t rpm) {
    const message_t message = {IW_CODEC_SPEED, wheel.side, {.speed = {.speed_rpm = rpm, .acceleration_raw = -1}}};
    iw_wheel_receive(&wheel, now_us, message.kind, &message.as, true);
}

/// The ticks change from one reading to another after `after_us`.
static iw_reboot_t jump_from(int32_t from, int32_t to, iw_time_us_t after_us) {
    begin_side(IW_LEFT);
    receive_ticks(from);
    const iw_time_us_t until_us = now_us + after_us;
    while (now_us + MS(500) < until_us) {
        now_us += MS(500);
        receive_speed(0);
    }
    now_us = until_us - MS(40);
    receive_ticks(to);
    return iw_wheel_next_reboot(&wheel);
}

/// The ticks jump by `ticks`, `after_us` after the previous status frame.
static iw_reboot_t jump(int32_t ticks, iw_time_us_t after_us) {
    return jump_from(5000, 5000 + ticks, after_us);
}

static int64_t distance_nm(void) {
    return wheel.ticks * wheel.nm_per_tick;
}

TEST(test_wheel_first_status_frame_is_no_distance) {
    receive_ticks(INT32_MIN);
    TEST_ASSERT_EQUAL_INT64(0, wheel.ticks);
    TEST_ASSERT_EQUAL_INT64(0, distance_nm());
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
}

TEST(test_wheel_ticks_add_up_in_both_directions) {
    receive_ticks(100);
    receive_ticks(110);
    TEST_ASSERT_EQUAL_INT64(10, wheel.ticks);
    receive_ticks(85);
    TEST_ASSERT_EQUAL_INT64(-15, wheel.ticks);
}

TEST(test_wheel_ticks_unwrap_in_both_directions) {
    receive_ticks(INT32_MAX - 4);
    receive_ticks(INT32_MIN + 5);
    TEST_ASSERT_EQUAL_INT64(10, wheel.ticks);
    receive_ticks(INT32_MAX);
    TEST_ASSERT_EQUAL_INT64(4, wheel.ticks);
    receive_ticks(INT32_MIN);
    TEST_ASSERT_EQUAL_INT64(5, wheel.ticks);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
}

TEST(test_wheel_ticks_continue_beyond_32_bits) {
    config.radius_mm = 20;
    config.gear_turns = 100;
    begin_side(IW_LEFT);
    wheel.ticks = INT32_MAX;
    receive_ticks(-20);
    receive_ticks(0);
    receive_ticks(20);
    TEST_ASSERT_EQUAL_INT64((int64_t)INT32_MAX + 40, wheel.ticks);
    TEST_ASSERT_TRUE(distance_nm() == ((int64_t)INT32_MAX + 40) * (int64_t)wheel.nm_per_tick);
}

TEST(test_wheel_ticks_end_at_their_limit_in_both_directions) {
    receive_ticks(0);
    wheel.ticks = IW_WHEEL_TICKS_MAX;
    receive_ticks(1);
    TEST_ASSERT_EQUAL_INT64(IW_WHEEL_TICKS_MAX + 1, wheel.ticks);
    receive_ticks(2);
    TEST_ASSERT_EQUAL_INT64(IW_WHEEL_TICKS_MAX + 1, wheel.ticks);
    wheel.ticks = -IW_WHEEL_TICKS_MAX;
    receive_ticks(1);
    TEST_ASSERT_EQUAL_INT64(-IW_WHEEL_TICKS_MAX - 1, wheel.ticks);
    receive_ticks(0);
    TEST_ASSERT_EQUAL_INT64(-IW_WHEEL_TICKS_MAX - 1, wheel.ticks);
}

TEST(test_wheel_distance_at_the_limit_of_ticks_does_not_overflow) {
    config.radius_mm = 500;
    begin_side(IW_LEFT);
    wheel.ticks = IW_WHEEL_TICKS_MAX;
    TEST_ASSERT_EQUAL_INT64(5236000000000000000, distance_nm());
}

TEST(test_wheel_jump_beyond_physics_is_a_reboot_not_a_distance) {
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(1000, MS(40)));
    TEST_ASSERT_EQUAL_INT64(0, wheel.ticks);
    TEST_ASSERT_EQUAL_UINT32(1, wheel.reboots);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(-1000, MS(40)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(INT32_MAX - 5000, MS(40)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(INT32_MIN, MS(40)));
    receive_ticks(5001 + INT32_MIN);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    TEST_ASSERT_TRUE(wheel.ticks <= 1);
}

/// 10 m/s are 0.4973 ticks per millisecond.
TEST(test_wheel_jump_is_judged_by_the_time_it_took) {
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump(30, MS(40)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump(-30, MS(40)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump(49, MS(40)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump(-49, MS(40)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(50, MS(40)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(-50, MS(40)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump(4970, MS(10000)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump(-4970, MS(10000)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(5050, MS(10000)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(-5050, MS(10000)));
}

TEST(test_wheel_small_jump_is_accepted_at_any_interval) {
    const message_t first = {IW_CODEC_STATUS, IW_LEFT, {.status = {0, 0, 0, 0}}};
    const message_t second = {IW_CODEC_STATUS, IW_LEFT, {.status = {30, 0, 0, 0}}};
    const message_t third = {IW_CODEC_STATUS, IW_LEFT, {.status = {61, 0, 0, 0}}};
    iw_wheel_receive(&wheel, now_us, first.kind, &first.as, true);
    iw_wheel_receive(&wheel, now_us, second.kind, &second.as, true);
    TEST_ASSERT_EQUAL_INT64(30, wheel.ticks);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    iw_wheel_receive(&wheel, now_us, third.kind, &third.as, true);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, iw_wheel_next_reboot(&wheel));
}

TEST(test_wheel_jump_after_hours_without_status_is_still_judged) {
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(INT32_MAX - 5000, MS(4294967 + 100000)));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump(2000000, MS(4294967 + 100000)));
}

/// One tick of a wheel of 192 mm is 20.10619 mm, 1 rpm is 20.10619 mm/s.
TEST(test_wheel_jump_is_judged_to_the_microsecond) {
    config.radius_mm = 500; // 5236 us per tick at 10 m/s.
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump(40, 52360));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump(40, 52359));
}

TEST(test_wheel_jump_of_2_31_ticks_is_judged_to_the_tick) {
    config.radius_mm = 20;
    config.gear_turns = 100; // 2 us per tick at 10 m/s: the counter reaches its end in 71 minutes.
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, jump_from(0, INT32_MAX, 4294967233U));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump_from(0, INT32_MAX, 4294967234U));
    TEST_ASSERT_EQUAL_INT64(INT32_MAX, wheel.ticks);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, jump_from(0, INT32_MIN, UINT32_MAX));
    TEST_ASSERT_EQUAL_INT64(INT32_MIN, wheel.ticks);
}

TEST(test_wheel_distance_and_speed_match_the_documented_wheel) {
    receive_ticks(0);
    receive_ticks(10);
    TEST_ASSERT_INT64_WITHIN(1000, 201061930, distance_nm());
    receive_speed(100);
    TEST_ASSERT_EQUAL_INT(2010, wheel.speed_mm_s);
    receive_speed(-100);
    TEST_ASSERT_EQUAL_INT(-2010, wheel.speed_mm_s);
    receive_speed(1);
    TEST_ASSERT_EQUAL_INT(20, wheel.speed_mm_s);
    receive_speed(-1);
    TEST_ASSERT_EQUAL_INT(-20, wheel.speed_mm_s);
    receive_speed(0);
    TEST_ASSERT_EQUAL_INT(0, wheel.speed_mm_s);
}

TEST(test_wheel_gear_ratio_divides_ticks_and_rotor_rpm_only) {
    config.gear_turns = 25;
    config.gear_per = 2;
    begin_side(IW_LEFT);
    receive_ticks(0);
    receive_ticks(25);
    TEST_ASSERT_INT64_WITHIN(1000, 40212386, distance_nm());
    receive_speed(100);
    TEST_ASSERT_EQUAL_INT(2010, wheel.speed_mm_s);
    config.rpm_of_rotor = true;
    begin_side(IW_LEFT);
    receive_speed(1000);
    TEST_ASSERT_INT_WITHIN(1, 1608, wheel.speed_mm_s);
}

/// 2 pi r / 60 in whole nanometres, by the rational 355/113 (relative error 1e-7).
static int64_t nm_per_turn_60th(uint32_t radius_mm) {
    return (int64_t)radius_mm * 1000000 * 355 / (113 * 30);
}

TEST(test_wheel_geometry_is_exact_to_10_ppm_for_all_radii) {
    static const uint16_t radii_mm[] = {20, 33, 192, 499, 500};
    static const uint16_t gears[][2] = {{1, 1}, {3, 2}, {7, 3}, {100, 1}, {1000, 10}, {999, 998}};
    for (size_t r = 0; r < 5; r++) {
        for (size_t g = 0; g < 6; g++) {
            config.radius_mm = radii_mm[r];
            config.gear_turns = gears[g][0];
            config.gear_per = gears[g][1];
            begin_side(IW_LEFT);
            receive_ticks(0);
            receive_ticks(10);
            const int64_t expected_nm = nm_per_turn_60th(radii_mm[r]) * 10 * gears[g][1] / gears[g][0];
            const uint64_t margin_nm = (uint64_t)expected_nm / 100000U + 100U;
            TEST_ASSERT_INT64_WITHIN(margin_nm, expected_nm, distance_nm());
        }
    }
}

TEST(test_wheel_speed_extremes_do_not_overflow) {
    static const int16_t extremes[] = {32767, -32768};
    for (int rotor = 0; rotor < 2; rotor++) {
        config.radius_mm = 500;
        config.rpm_of_rotor = rotor != 0;
        begin_side(IW_LEFT);
        for (size_t i = 0; i < 2; i++) {
            receive_speed(extremes[i]);
            const int64_t expected_mm_s = nm_per_turn_60th(500) * extremes[i] / 1000000;
            TEST_ASSERT_INT64_WITHIN(40, expected_mm_s, wheel.speed_mm_s);
        }
    }
}

TEST(test_wheel_inverted_negates_distance_and_speed_but_not_ticks) {
    config.invert[IW_RIGHT] = true;
    begin_side(IW_RIGHT);
    receive_ticks(0);
    receive_ticks(10);
    receive_speed(100);
    TEST_ASSERT_EQUAL_INT64(10, wheel.ticks);
    TEST_ASSERT_INT64_WITHIN(1000, -201061930, distance_nm());
    TEST_ASSERT_EQUAL_INT(-2010, wheel.speed_mm_s);
    begin_side(IW_LEFT);
    receive_speed(100);
    TEST_ASSERT_EQUAL_INT(2010, wheel.speed_mm_s);
}

TEST(test_wheel_distance_survives_reboots) {
    receive_ticks(1000);
    receive_ticks(1010);
    receive_ticks(0);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, iw_wheel_next_reboot(&wheel));
    receive_ticks(7);
    TEST_ASSERT_EQUAL_INT64(17, wheel.ticks);
}
