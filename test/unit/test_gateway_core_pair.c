// SPDX-License-Identifier: MIT
// The pair in the whole gateway: what is compared and when, which wheel is named, ramp or immediate zero, which request
// is refused.
#include "test_gateway_core_rig.h"

#include "unit.h"

static void assert_diverged(iw_side_t side, bool at_once) {
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_PAIR_DIVERGES, stop()->cause);
    TEST_ASSERT_EQUAL_UINT8((side == IW_LEFT) ? IW_SIDES_LEFT : IW_SIDES_RIGHT, stop()->sides);
    TEST_ASSERT_EQUAL_INT(at_once, stop()->at_once);
    TEST_ASSERT_FALSE(stop()->latched);
    TEST_ASSERT_UINT32_WITHIN(2, 61, stop()->detail);
    TEST_ASSERT_EQUAL_INT(at_once, gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_one_wheel_blocked_sends_zero_to_both) {
    for (int side = 0; side < IW_SIDES; side++) {
        setUp();
        drive_on();
        turn((iw_side_t)side, 0);
        (void)gateway_rig_cruise(&rig, 400, 400, MS(60));
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
        const iw_refusal_t refusal = gateway_rig_cruise(&rig, 400, 400, MS(60));
        assert_diverged((iw_side_t)side, true);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_PAIR_DIVERGES, refusal);
        tearDown();
    }
}

TEST(test_gateway_one_wheel_too_fast_ramps_both) {
    for (int side = 0; side < IW_SIDES; side++) {
        setUp();
        drive_on();
        turn((iw_side_t)side, 36); // 724 mm/s
        (void)gateway_rig_cruise(&rig, 400, 400, MS(240));
        assert_diverged((iw_side_t)side, false);
        TEST_ASSERT_EQUAL_INT(rig.bus.commanded_mm_s[IW_LEFT], rig.bus.commanded_mm_s[IW_RIGHT]);
        tearDown();
    }
}

TEST(test_gateway_pair_in_a_curve_as_commanded_does_not_diverge) {
    gateway_rig_arm(&rig);
    for (unsigned i = 0; i < 10U; i++) {
        (void)gateway_rig_cruise(&rig, 400, 100, MS(1000));
        (void)gateway_rig_cruise(&rig, 100, 400, MS(1000));
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_wheel_blocked_in_a_ramp_ends_the_ramp) {
    arm_and_cruise(1000, 1000, MS(2000));
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(40));
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
    turn(IW_LEFT, 0);
    gateway_rig_run(&rig, MS(80));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_STOP, stop()->cause);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_too_fast_wheel_in_a_ramp_does_not_end_it) {
    arm_and_cruise(1000, 1000, MS(2000));
    turn(IW_LEFT, 49);
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(420));
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
    TEST_ASSERT_TRUE(rig.gateway.permit.seen_us[IW_CAUSE_PAIR_DIVERGES] != IW_NEVER);
}

TEST(test_gateway_pair_pushed_while_listening_is_not_compared) {
    gateway_rig_run(&rig, MS(500));
    turn(IW_LEFT, 40);
    gateway_rig_run(&rig, MS(2000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_TRUE(rig.gateway.permit.seen_us[IW_CAUSE_PAIR_DIVERGES] == IW_NEVER);
    TEST_ASSERT_EQUAL_INT32(0, gateway_rig_snapshot(&rig).pair_largest_mm);
}

TEST(test_gateway_pair_pushed_while_armed_stops) {
    gateway_rig_arm(&rig);
    turn(IW_RIGHT, -10);
    (void)gateway_rig_cruise(&rig, 0, 0, MS(500));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_PAIR_DIVERGES, stop()->cause);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_RIGHT, stop()->sides);
    TEST_ASSERT_FALSE(stop()->at_once);
}

/// During an immediate zero both wheels brake as they can: this is no deviation.
TEST(test_gateway_pair_with_immediate_zero_is_not_compared) {
    drive_on();
    turn(IW_LEFT, 10);
    gateway_rig_press(&rig, true);
    gateway_rig_run(&rig, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_ESTOP_LINE, stop()->cause);
    TEST_ASSERT_TRUE(rig.gateway.permit.seen_us[IW_CAUSE_PAIR_DIVERGES] == IW_NEVER);
}

/// A wheel that a late step made offline has its deviation again with its next frame; a lost one begins at zero.
TEST(test_gateway_deviation_is_reset_by_a_lost_wheel_not_by_a_late_step) {
    for (int side = 0; side < IW_SIDES; side++) {
        setUp();
        drive_on();
        turn((iw_side_t)side, 0);
        (void)gateway_rig_cruise(&rig, 400, 400, MS(50));
        const int32_t path_um = rig.gateway.diverge.path_um;
        TEST_ASSERT_TRUE(path_um > 20000 || path_um < -20000);
        rig.wheel[side].mute = true;
        stall_by(MS(90));
        TEST_ASSERT_FALSE(iw_wheel_online(&rig.gateway.wheel[side], rig.now_us));
        TEST_ASSERT_EQUAL_INT32(path_um, rig.gateway.diverge.path_um);
        gateway_rig_run(&rig, MS(20)); // Not online, and not late.
        TEST_ASSERT_EQUAL_INT32(path_um, rig.gateway.diverge.path_um);
        gateway_rig_run(&rig, MS(100));
        TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, stop()->cause);
        TEST_ASSERT_EQUAL_INT32(0, rig.gateway.diverge.path_um);
        tearDown();
    }
}

TEST(test_gateway_wheel_offline_is_not_compared_by_its_old_speed) {
    drive_on();
    turn(IW_LEFT, 10);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(40));
    rig.wheel[IW_LEFT].mute = true;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(70));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, stop()->cause);
    gateway_rig_run(&rig, MS(150));
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
    TEST_ASSERT_EQUAL_INT32(0, rig.gateway.diverge.path_um);
    TEST_ASSERT_TRUE(rig.gateway.permit.seen_us[IW_CAUSE_PAIR_DIVERGES] == IW_NEVER);
}

/// Also in STOPPING: a late loop stops without a ramp, and the wheels brake as they can.
TEST(test_gateway_pair_after_a_late_loop_is_not_compared) {
    drive_on();
    (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
    stall_by(MS(110));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LOOP_LATE, stop()->cause);
    turn(IW_LEFT, 15);
    gateway_rig_run(&rig, MS(500));
    TEST_ASSERT_EQUAL_INT32(0, rig.gateway.diverge.path_um);
    TEST_ASSERT_INT32_WITHIN(1000, 301000, rig.gateway.diverge.expected_um_s[IW_LEFT]);
}

/// A person pushes the machine while zeros are held: there is nothing to stop, and the next arm begins at zero.
TEST(test_gateway_pair_pushed_during_the_hold_is_not_compared) {
    drive_on();
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(600));
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    turn(IW_LEFT, 20);
    gateway_rig_run(&rig, MS(500));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT32(0, rig.gateway.diverge.path_um);
    TEST_ASSERT_TRUE(rig.gateway.permit.seen_us[IW_CAUSE_PAIR_DIVERGES] == IW_NEVER);
}

/// After a pair that could not be sent as a whole, zero follows immediately, although the client continues.
TEST(test_gateway_deviation_is_reset_after_an_unsent_pair) {
    drive_on();
    turn(IW_LEFT, 10);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(40));
    TEST_ASSERT_GREATER_THAN_INT32(4000, rig.gateway.diverge.path_um);
    iw_setpoint_collapse(&rig.gateway.setpoint, rig.now_us);
    rig.gateway.setpoint.due_us = rig.now_us + MS(1);
    (void)iw_gateway_step(&rig.gateway, rig.now_us);
    TEST_ASSERT_EQUAL_INT32(0, rig.gateway.diverge.path_um);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_measured_speeds_are_mm_s_in_machine_frame) {
    rig.config.invert[IW_RIGHT] = true;
    gateway_rig_begin(&rig, false);
    turn(IW_LEFT, 50);
    turn(IW_RIGHT, 50);
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_EQUAL_INT32(1005, rig.gateway.diverge.measured_mm_s[IW_LEFT]); // 50 x 20.106
    TEST_ASSERT_EQUAL_INT32(-1005, rig.gateway.diverge.measured_mm_s[IW_RIGHT]);
}

TEST(test_gateway_deviation_is_reported_in_whole_millimetres) {
    arm_and_cruise(1000, 1000, MS(2000));
    TEST_ASSERT_EQUAL_INT32(1000, rig.gateway.diverge.applied_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT32(1000, rig.gateway.diverge.applied_mm_s[IW_RIGHT]);
    rig.gateway.diverge.path_um = 61000;
    rig.gateway.diverge.at_us = rig.now_us;
    (void)iw_gateway_step(&rig.gateway, rig.now_us);
    TEST_ASSERT_EQUAL_UINT32(61, stop()->detail);
    setUp();
    arm_and_cruise(1000, 1000, MS(2000));
    rig.gateway.diverge.path_um = 61999;
    rig.gateway.diverge.at_us = rig.now_us;
    (void)iw_gateway_step(&rig.gateway, rig.now_us);
    TEST_ASSERT_EQUAL_UINT32(61, stop()->detail);
}

TEST(test_gateway_deviation_restarts_with_each_drive) {
    drive_on();
    turn(IW_LEFT, 0);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(200));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_PAIR_DIVERGES, stop()->cause);
    TEST_ASSERT_GREATER_OR_EQUAL_INT32(60, gateway_rig_snapshot(&rig).pair_largest_mm);
    rig.wheel[IW_LEFT].rpm_fixed = false;
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_GREATER_OR_EQUAL_INT32(60, gateway_rig_snapshot(&rig).pair_largest_mm);
    gateway_rig_arm(&rig);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT32(0, gateway_rig_snapshot(&rig).pair_largest_mm);
    TEST_ASSERT_EQUAL_INT32(0, gateway_rig_snapshot(&rig).pair_mm);
}

TEST(test_gateway_third_divergence_within_a_minute_latches) {
    for (unsigned i = 0; i < 3U; i++) {
        arm_and_cruise(400, 400, MS(1000));
        turn(IW_RIGHT, 0);
        (void)gateway_rig_cruise(&rig, 400, 400, MS(200));
        TEST_ASSERT_EQUAL_INT((i < 2U) ? IW_STATE_STOPPING : IW_STATE_LATCHED, state());
        rig.wheel[IW_RIGHT].rpm_fixed = false;
        gateway_rig_run(&rig, MS(3000));
    }
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
}

TEST(test_gateway_second_offline_wheel_ends_the_ramp) {
    arm_and_cruise(1000, 1000, MS(2000));
    rig.wheel[IW_LEFT].mute = true;
    (void)gateway_rig_cruise(&rig, 1000, 1000, MS(20));
    rig.wheel[IW_RIGHT].mute = true;
    (void)gateway_rig_cruise(&rig, 1000, 1000, MS(44));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, stop()->cause);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_LEFT, stop()->sides);
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
    gateway_rig_run(&rig, MS(20));
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_pair_is_compared_in_the_machine_frame) {
    rig.config.invert[IW_RIGHT] = true;
    gateway_rig_begin(&rig, false);
    arm_and_cruise(400, 400, MS(3000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_LESS_THAN_INT32(5, gateway_rig_snapshot(&rig).pair_largest_mm);
}
