// SPDX-License-Identifier: MIT
// Faults while the wheels move: e-stop button, second master, offline or faulty wheels, late steps of the gateway.
#include "test_gateway_core_rig.h"
#include "unit.h"

static void assert_latched(iw_cause_t cause) {
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_INT(cause, stop()->cause);
    TEST_ASSERT_TRUE(stop()->latched);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

/// One wheel is offline: from 400 mm/s the common ramp lasts 267 ms.
static void assert_latched_with_a_ramp(void) {
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, stop()->cause);
    TEST_ASSERT_FALSE(stop()->at_once);
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
    TEST_ASSERT_EQUAL_INT(rig.bus.commanded_mm_s[IW_LEFT], rig.bus.commanded_mm_s[IW_RIGHT]);
    gateway_rig_run(&rig, MS(200));
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
    gateway_rig_run(&rig, MS(100));
    assert_latched(IW_CAUSE_WHEEL_LOST);
}

static void assert_no_motion_until_armed_again(void) {
    (void)gateway_rig_cruise(&rig, 400, 400, MS(300));
    gateway_rig_run(&rig, MS(1100));
    (void)gateway_rig_reset(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_estop_in_motion_sends_zeros_in_the_same_step) {
    for (uint32_t phase_us = 0; phase_us <= 20000; phase_us += 500) {
        setUp();
        drive_on();
        (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
        gateway_rig_run(&rig, phase_us);
        gateway_rig_press(&rig, true);
        gateway_rig_step(&rig);
        assert_latched(IW_CAUSE_ESTOP_LINE);
        TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.bus.last_us[IW_LEFT]);
        TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.bus.last_us[IW_RIGHT]);
        TEST_ASSERT_EQUAL_UINT32(1, stop()->detail);
        tearDown();
    }
}

TEST(test_gateway_estop_after_an_unechoed_pair_does_not_wait) {
    drive_on();
    rig.bus.echo_delay_us = MS(15);
    gateway_rig_run(&rig, MS(20));
    for (unsigned i = 0; i < 300U && rig.bus.unechoed[IW_LEFT] == 0; i++) {
        gateway_rig_run(&rig, 100);
    }
    TEST_ASSERT_TRUE(rig.bus.unechoed[IW_LEFT] > 0);
    gateway_rig_press(&rig, true);
    gateway_rig_step(&rig);
    assert_latched(IW_CAUSE_ESTOP_LINE);
    TEST_ASSERT_EQUAL_UINT8(2, rig.bus.unechoed[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT8(2, rig.bus.unechoed[IW_RIGHT]);
}

TEST(test_gateway_estop_edge_alone_latches) {
    drive_on();
    rig.bus.estop_edge = true;
    gateway_rig_step(&rig);
    assert_latched(IW_CAUSE_ESTOP_LINE);
    assert_no_motion_until_armed_again();
}

TEST(test_gateway_estop_disagreement_latches_until_they_agree) {
    drive_on();
    rig.bus.estop_level = IW_ESTOP_DISAGREES;
    gateway_rig_step(&rig);
    assert_latched(IW_CAUSE_ESTOP_DISAGREES);
    TEST_ASSERT_TRUE(stop()->at_once);
    TEST_ASSERT_EQUAL_UINT32(1, stop()->detail);
    gateway_rig_run(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_CAUSE_PRESENT, gateway_rig_reset(&rig));
    rig.bus.estop_level = 0;
    gateway_rig_run(&rig, MS(1500));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_reset(&rig));
}

TEST(test_gateway_estop_disagreement_after_press_is_present) {
    drive_on();
    gateway_rig_press(&rig, true);
    gateway_rig_step(&rig);
    assert_latched(IW_CAUSE_ESTOP_LINE);
    rig.bus.estop_level = IW_ESTOP_DISAGREES;
    gateway_rig_run(&rig, MS(100));
    assert_latched(IW_CAUSE_ESTOP_LINE);
    TEST_ASSERT_EQUAL_HEX32(1U << IW_CAUSE_ESTOP_DISAGREES, iw_permit_present(&rig.gateway.permit, rig.now_us));
}

TEST(test_gateway_estop_unreadable_latches_in_every_state) {
    rig.bus.estop_level = -1;
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_UINT32(2, stop()->detail);
    gateway_rig_run(&rig, MS(2000));
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.sent);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_ESTOP_PRESSED, gateway_rig_reset(&rig));
    rig.bus.estop_level = 0;
    gateway_rig_run(&rig, MS(1));
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_reset(&rig));
}

TEST(test_gateway_estop_held_refuses_every_request) {
    drive_on();
    gateway_rig_press(&rig, true);
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_ESTOP_PRESSED, gateway_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_ESTOP_PRESSED, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_ESTOP_PRESSED, gateway_rig_drive(&rig, HOLDER, 1, 1));
    gateway_rig_press(&rig, false);
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_UINT32(1, stop()->number);
}

TEST(test_gateway_software_estop_latches_from_any_client) {
    drive_on();
    iw_gateway_estop(&rig.gateway, rig.now_us, OTHER);
    gateway_rig_step(&rig);
    assert_latched(IW_CAUSE_ESTOP_SOFTWARE);
    TEST_ASSERT_EQUAL_UINT32(OTHER, stop()->detail);
    TEST_ASSERT_EQUAL_INT(400, stop()->applied.wheel[IW_LEFT].speed_mm_s);
    assert_no_motion_until_armed_again();
}

TEST(test_gateway_reset_while_a_client_drives_is_stale) {
    drive_on();
    iw_gateway_estop(&rig.gateway, rig.now_us, OTHER);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(2000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_STALE_COMMAND, gateway_rig_reset(&rig));
}

TEST(test_gateway_second_master_latches_armed_and_stopping) {
    static const uint32_t ids[] = {IW_ID_LEFT_SETPOINT, IW_ID_RIGHT_SETPOINT};
    for (uint32_t i = 0; i < 4; i++) {
        setUp();
        drive_on();
        if (i >= 2) {
            gateway_rig_stop(&rig);
        }
        gateway_rig_foreign(&rig, ids[i % 2U]);
        gateway_rig_step(&rig);
        assert_latched(IW_CAUSE_SECOND_MASTER);
        TEST_ASSERT_EQUAL_UINT32(ids[i % 2U], stop()->detail);
        TEST_ASSERT_EQUAL_UINT8((i % 2U == 0) ? IW_SIDES_LEFT : IW_SIDES_RIGHT, stop()->sides);
        tearDown();
    }
}

TEST(test_gateway_second_master_while_listening_refuses_arm) {
    gateway_rig_run(&rig, MS(1000));
    gateway_rig_foreign(&rig, 266);
    fake_bus_put_empty(&rig.bus, 298, 0);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(2, rig.gateway.counters.foreign);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SECOND_MASTER, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(999));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SECOND_MASTER, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.sent);
    gateway_rig_run(&rig, MS(2));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
}

TEST(test_gateway_second_master_while_arming_ends_it) {
    gateway_rig_run(&rig, MS(1000));
    rig.bus.echo_delay_us = MS(10);
    (void)gateway_rig_request_arm(&rig, HOLDER, false);
    gateway_rig_foreign(&rig, 266);
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SECOND_MASTER, iw_gateway_arm_refusal(&rig.gateway));
}

TEST(test_gateway_offline_wheel_latches_within_limit_and_period) {
    for (int side = 0; side < IW_SIDES; side++) {
        setUp();
        drive_on();
        rig.wheel[side].mute = true;
        (void)gateway_rig_cruise(&rig, 400, 400, MS(45));
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
        (void)gateway_rig_cruise(&rig, 400, 400, MS(30));
        assert_latched_with_a_ramp();
        TEST_ASSERT_EQUAL_UINT8((side == IW_LEFT) ? IW_SIDES_LEFT : IW_SIDES_RIGHT, stop()->sides);
        const iw_time_us_t silent_us = stop()->at_us - rig.gateway.wheel[side].received_us;
        TEST_ASSERT_UINT32_WITHIN(20, 60, stop()->detail);
        TEST_ASSERT_EQUAL_UINT32(silent_us / 1000U, stop()->detail);
        gateway_rig_run(&rig, MS(1100));
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_WHEEL_LOST, gateway_rig_reset(&rig));
        tearDown();
    }
}

TEST(test_gateway_both_wheels_offline_are_both_named) {
    drive_on();
    set_mute(true);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(80));
    assert_latched(IW_CAUSE_WHEEL_LOST);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_BOTH, stop()->sides);
}

/// The wheel sends nothing more, and causes no step any more.
static void fall_silent(int side) {
    rig.wheel[side].speed_us = rig.wheel[side].status_us = IW_NEVER;
}

/// Without frames only the time that the last step returned causes a step, and setpoints are due at other times.
static void assert_zero_at_the_limit_of(int later, uint32_t phase_us) {
    drive_on();
    gateway_rig_run(&rig, phase_us);
    fall_silent(IW_SIDES - 1 - later);
    gateway_rig_run(&rig, MS(4));
    fall_silent(later);
    const iw_time_us_t limit_us = rig.gateway.wheel[later].received_us + MS(rig.config.wheel_silent_ms);
    gateway_rig_run(&rig, limit_us + IW_SETPOINT_SPACING_US - rig.now_us);
    assert_latched(IW_CAUSE_WHEEL_LOST);
    TEST_ASSERT_LESS_OR_EQUAL_UINT64(limit_us, stop()->at_us);
}

TEST(test_gateway_both_wheels_offline_latch_at_the_limit) {
    for (uint32_t phase_us = 0; phase_us < 20000; phase_us += 500) {
        for (int later = 0; later < IW_SIDES; later++) {
            setUp();
            assert_zero_at_the_limit_of(later, phase_us);
            tearDown();
        }
    }
}

/// The time that a step returns can be the limit of both wheels. A stall from there on is no fault of the wheels.
TEST(test_gateway_stall_at_the_limit_of_both_wheels_is_excused) {
    rig.config.wheel_silent_ms = 20;
    rig.config.period_ms = 50;
    gateway_rig_begin(&rig, false);
    drive_on();
    for (uint32_t ms = 30; ms < 60; ms++) {
        (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
        gateway_rig_stall(&rig, MS(ms));
        (void)gateway_rig_cruise(&rig, 400, 400, MS(100));
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    }
}

/// Only the limit of both wheels excuses both. Here one wheel sends, and a pair is due soon after the limit of the other.
TEST(test_gateway_stall_after_the_limit_of_one_wheel_is_no_excuse) {
    int judged = 0;
    for (uint32_t phase_us = 0; phase_us < 20000; phase_us += 500) {
        setUp();
        drive_on();
        gateway_rig_run(&rig, phase_us);
        fall_silent(IW_LEFT);
        const iw_time_us_t limit_us = rig.gateway.wheel[IW_LEFT].received_us + MS(rig.config.wheel_silent_ms);
        gateway_rig_run(&rig, limit_us - 1U - rig.now_us);
        if (rig.gateway.promised_us >= limit_us) {
            judged++;
            gateway_rig_stall(&rig, MS(25));
            gateway_rig_run(&rig, MS(20));
            TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
            TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, stop()->cause);
        }
        tearDown();
    }
    TEST_ASSERT_GREATER_THAN_INT(3, judged);
}

/// A stall that begins at the limit of both wheels does not excuse a wheel that was offline a frame earlier.
TEST(test_gateway_stall_at_the_limit_of_both_is_no_excuse_for_one) {
    int judged = 0;
    for (uint32_t step = 0; step < 120; step++) {
        setUp();
        drive_on();
        gateway_rig_run(&rig, step / 3U * 500U);
        rig.wheel[IW_RIGHT].speed_us = rig.wheel[IW_LEFT].speed_us;
        fall_silent(IW_LEFT);
        gateway_rig_run(&rig, MS(4U + step % 3U * 4U));
        fall_silent(IW_RIGHT);
        const iw_time_us_t left_us = rig.gateway.wheel[IW_LEFT].received_until_us;
        const iw_time_us_t right_us = rig.gateway.wheel[IW_RIGHT].received_until_us;
        gateway_rig_run(&rig, left_us - 1U - rig.now_us);
        if (rig.gateway.promised_us == right_us && right_us - left_us >= IW_WHEEL_SPEED_PERIOD_US) {
            judged += (right_us - left_us == IW_WHEEL_SPEED_PERIOD_US) ? 1 : 0;
            gateway_rig_stall(&rig, MS(35));
            gateway_rig_run(&rig, MS(20));
            TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
        }
        tearDown();
    }
    TEST_ASSERT_GREATER_THAN_INT(3, judged);
}

/// The last frames showed standstill. If the zeros ended after `zero_hold_ms`, they would rely on frames that no longer
/// arrive.
TEST(test_gateway_wheel_offline_is_not_at_standstill) {
    for (int side = 0; side < IW_SIDES; side++) {
        setUp();
        arm_and_cruise(0, 0, MS(1000));
        TEST_ASSERT_TRUE(rig.gateway.permit.view.settled);
        rig.wheel[side].mute = true;
        gateway_rig_run(&rig, MS(5000));
        assert_latched(IW_CAUSE_WHEEL_LOST);
        TEST_ASSERT_FALSE(rig.gateway.permit.view.at_rest);
        TEST_ASSERT_EQUAL_INT(IW_PHASE_CUT, rig.gateway.permit.phase);
        rig.wheel[side].mute = false;
        gateway_rig_run(&rig, MS(1000));
        TEST_ASSERT_EQUAL_INT(IW_PHASE_LATCHED, rig.gateway.permit.phase);
        tearDown();
    }
}

TEST(test_gateway_arm_with_a_wheel_never_online_is_refused) {
    rig.wheel[IW_RIGHT].mute = true;
    gateway_rig_run(&rig, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_WHEEL_LOST, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(0, stop()->number);
}

TEST(test_gateway_rebooted_wheel_latches) {
    drive_on();
    rig.wheel[IW_LEFT].ticks = -40000;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(50));
    assert_latched(IW_CAUSE_WHEEL_REBOOTED);
    TEST_ASSERT_EQUAL_UINT32(IW_REBOOT_ODOMETRY, stop()->detail);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_LEFT, stop()->sides);
}

TEST(test_gateway_wheel_against_its_command_latches) {
    gateway_rig_begin_apart(&rig);
    drive_on();
    (void)gateway_rig_cruise(&rig, 120, 120, MS(500));
    turn(IW_RIGHT, -6);
    (void)gateway_rig_cruise(&rig, 120, 120, MS(295));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    (void)gateway_rig_cruise(&rig, 120, 120, MS(30));
    assert_latched(IW_CAUSE_FEEDBACK_SIGN);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_RIGHT, stop()->sides);
    TEST_ASSERT_EQUAL_UINT32(120, stop()->detail);
    TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, rig.gateway.assumptions.entry[IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT].state);
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, rig.gateway.assumptions.entry[IW_ASSUMPTION_FEEDBACK_SIGN_LEFT].state);
}

TEST(test_gateway_overspeeding_wheel_latches) {
    gateway_rig_begin_apart(&rig);
    drive_on();
    turn(IW_LEFT, 36);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(495));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    (void)gateway_rig_cruise(&rig, 400, 400, MS(30));
    assert_latched(IW_CAUSE_OVERSPEED);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_LEFT, stop()->sides);
}

TEST(test_gateway_blocked_wheel_stops_with_a_ramp_and_no_latch) {
    gateway_rig_begin_apart(&rig);
    drive_on();
    (void)gateway_rig_cruise(&rig, 120, 120, MS(500));
    turn(IW_LEFT, 1);
    (void)gateway_rig_cruise(&rig, 120, 120, MS(995));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    const iw_refusal_t refusal = gateway_rig_cruise(&rig, 120, 120, MS(60));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_WHEEL_BLOCKED, refusal);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_BLOCKED, stop()->cause);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_LEFT, stop()->sides);
    TEST_ASSERT_EQUAL_UINT32(20, stop()->detail);
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_pushed_wheel_while_listening_is_no_fault) {
    turn(IW_LEFT, 60);
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, gateway_rig_request_arm(&rig, HOLDER, false));
}

/// Makes a step while driving that is this much later than the gateway requested.
static void stall_in_motion(iw_time_us_t late_us) {
    setUp();
    drive_on();
    (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
    stall_by(late_us);
}

TEST(test_gateway_late_step_is_counted_above_20_ms) {
    stall_in_motion(MS(20));
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.late_steps);
    stall_in_motion(MS(20) + 1U);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.late_steps);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_late_by_100_ms_stops_without_a_ramp) {
    stall_in_motion(MS(100) - 1U);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    stall_in_motion(MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LOOP_LATE, stop()->cause);
    TEST_ASSERT_EQUAL_UINT32(100, stop()->detail);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.bus.last_us[IW_LEFT]);
}

TEST(test_gateway_late_by_more_than_500_ms_latches) {
    stall_in_motion(MS(500));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LOOP_LATE, stop()->cause);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    stall_in_motion(MS(500) + 1U);
    assert_latched(IW_CAUSE_LOOP_HUNG);
    TEST_ASSERT_EQUAL_UINT32(500, stop()->detail);
    stall_in_motion(MS(5000000));
    assert_latched(IW_CAUSE_LOOP_HUNG);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX / 1000U, stop()->detail);
}

TEST(test_gateway_late_step_during_the_ramp_sends_zero) {
    drive_on();
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(60));
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
    stall_by(MS(150));
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_late_step_does_not_change_the_loss_of_a_wheel) {
    drive_on();
    (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
    rig.wheel[IW_LEFT].mute = true;
    stall_by(MS(60));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    gateway_rig_run(&rig, MS(45));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    (void)gateway_rig_cruise(&rig, 400, 400, MS(30));
    assert_latched_with_a_ramp();
}

TEST(test_gateway_backlog_after_a_late_step_has_unknown_age) {
    drive_on();
    (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
    rig.bus.flood = 900;
    stall_by(MS(60));
    TEST_ASSERT_TRUE(rig.gateway.backlog);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.wake_us);
    gateway_rig_step(&rig);
    TEST_ASSERT_FALSE(rig.gateway.backlog);
    TEST_ASSERT_FALSE(iw_wheel_online(&rig.gateway.wheel[IW_LEFT], rig.now_us));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    (void)gateway_rig_cruise(&rig, 400, 400, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_TRUE(iw_wheel_online(&rig.gateway.wheel[IW_LEFT], rig.now_us));
}

TEST(test_gateway_frame_stopped_by_the_envelope_is_internal) {
    drive_on();
    rig.gateway.config.max_speed_mm_s = 100;
    gateway_rig_run(&rig, MS(20));
    assert_latched(IW_CAUSE_INTERNAL);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_NONE, stop()->sides);
    TEST_ASSERT_EQUAL_UINT32(IW_ENVELOPE_SPEED, stop()->detail);
    TEST_ASSERT_TRUE(rig.gateway.sender.envelope.stopped > 0);
}
