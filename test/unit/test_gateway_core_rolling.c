// SPDX-License-Identifier: MIT
// A machine that rolls without setpoints: the gateway detects it, without another effect.
#include "test_gateway_core_rig.h"
#include "unit.h"

/// 120.6 mm/s and 100.5 mm/s, and the rpm below. With one more millimetre of radius the second speed is 101 mm/s.
#define FAST_RPM  6
#define LEAST_RPM 5
#define SLOW_RPM  4

static bool rolls(void) {
    return gateway_rig_snapshot(&rig).rolling;
}

static bool is_fault(void) {
    return gateway_rig_snapshot(&rig).rolling_fault;
}

TEST(test_gateway_rolling_while_listening_is_detected) {
    gateway_rig_run(&rig, MS(1000));
    const uint32_t frames = rig.judge.frames;
    turn(IW_LEFT, 75);
    turn(IW_RIGHT, 75);
    gateway_rig_run(&rig, MS(290));
    TEST_ASSERT_FALSE(rolls());
    gateway_rig_run(&rig, MS(50));
    TEST_ASSERT_TRUE(rolls());
    TEST_ASSERT_FALSE(is_fault());
    TEST_ASSERT_EQUAL_UINT32(frames, rig.judge.frames);
    TEST_ASSERT_EQUAL_UINT32(0, stop()->number);
    turn(IW_LEFT, 0);
    turn(IW_RIGHT, 0);
    gateway_rig_run(&rig, MS(350));
    TEST_ASSERT_FALSE(rolls());
}

TEST(test_gateway_rolling_of_one_wheel_in_either_direction_counts) {
    static const int16_t rpm[] = {FAST_RPM, -FAST_RPM, LEAST_RPM, SLOW_RPM, -SLOW_RPM};
    for (size_t i = 0; i < 10U; i++) {
        gateway_rig_init(&rig);
        turn(i % 2U, rpm[i / 2U]);
        gateway_rig_run(&rig, MS(400));
        TEST_ASSERT_EQUAL_INT(i / 2U < 2U, rolls());
    }
}

TEST(test_gateway_rolling_counts_above_100_mm_s) {
    rig.config.radius_mm = 193;
    gateway_rig_begin(&rig, false);
    turn(IW_RIGHT, LEAST_RPM);
    gateway_rig_run(&rig, MS(400));
    TEST_ASSERT_EQUAL_INT32(101, rig.gateway.wheel[IW_RIGHT].speed_mm_s);
    TEST_ASSERT_TRUE(rolls());
}

TEST(test_gateway_rolling_after_power_on_is_no_fault) {
    gateway_rig_power_on(&rig);
    turn(IW_LEFT, FAST_RPM);
    gateway_rig_run(&rig, MS(400));
    TEST_ASSERT_TRUE(rolls());
    TEST_ASSERT_FALSE(is_fault());
}

/// A driven wheel does not roll, nor a wheel that is commanded zero.
TEST(test_gateway_rolling_is_not_judged_while_setpoints_are_sent) {
    arm_and_cruise(300, 300, MS(1000));
    TEST_ASSERT_FALSE(rolls());
    gateway_rig_stop(&rig);
    turn(IW_LEFT, FAST_RPM);
    turn(IW_RIGHT, FAST_RPM);
    gateway_rig_run(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_FALSE(rolls());
}

TEST(test_gateway_rolling_soon_after_the_zeros_is_a_fault) {
    gateway_rig_arm(&rig);
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(2000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    gateway_rig_run(&rig, MS(9000));
    turn(IW_RIGHT, -FAST_RPM);
    gateway_rig_run(&rig, MS(400));
    TEST_ASSERT_TRUE(rolls());
    TEST_ASSERT_TRUE(is_fault());
    turn(IW_RIGHT, 0);
    gateway_rig_run(&rig, MS(1000));
    TEST_ASSERT_FALSE(is_fault());
    turn(IW_RIGHT, -FAST_RPM);
    gateway_rig_run(&rig, MS(400));
    TEST_ASSERT_TRUE(rolls());
    TEST_ASSERT_FALSE(is_fault());
}

TEST(test_gateway_offline_wheel_does_not_roll) {
    turn(IW_LEFT, FAST_RPM);
    gateway_rig_run(&rig, MS(400));
    TEST_ASSERT_TRUE(rolls());
    rig.wheel[IW_LEFT].mute = true;
    gateway_rig_run(&rig, MS(400));
    TEST_ASSERT_FALSE(rolls());
}

/// Frames of a late step have no known time: they neither begin nor end anything.
TEST(test_gateway_late_step_does_not_judge_rolling) {
    gateway_rig_run(&rig, MS(100));
    turn(IW_LEFT, FAST_RPM);
    gateway_rig_run(&rig, MS(10));
    gateway_rig_stall(&rig, MS(400));
    TEST_ASSERT_FALSE(rolls());
}
