// SPDX-License-Identifier: MIT
// Limits to the microsecond, and counters to the frame.
#include "test_gateway_core_rig.h"
#include "unit.h"

/// Runs until the next pair is sent.
static void run_to_next_pair(void) {
    const iw_time_us_t last_us = rig.bus.last_us[IW_LEFT];
    while (rig.bus.last_us[IW_LEFT] == last_us) {
        gateway_rig_run(&rig, 100);
    }
}

static void turn_both(int16_t rpm) {
    turn(IW_LEFT, rpm);
    turn(IW_RIGHT, rpm);
}

TEST(test_gateway_counts_sent_and_refused_pairs) {
    gateway_rig_arm(&rig);
    const iw_sender_t *const sender = &rig.gateway.sender;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(500));
    TEST_ASSERT_EQUAL_UINT32(rig.bus.sent, 2U * sender->sent.pairs);
    TEST_ASSERT_EQUAL_UINT32(0, sender->sent.later);
    TEST_ASSERT_EQUAL_UINT32(0, sender->sent.clamped);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, sender->verdict);
    const uint32_t pairs = sender->sent.pairs;
    rig.bus.send_result[IW_RIGHT] = 0;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(30));
    TEST_ASSERT_EQUAL_UINT32(pairs, sender->sent.pairs);
    TEST_ASSERT_EQUAL_UINT32(rig.bus.refused, sender->sent.later);
    TEST_ASSERT_TRUE(sender->sent.later > 0);
}

TEST(test_gateway_counts_telemetry) {
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_UINT32_WITHIN(6, 1650, rig.gateway.counters.received);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.unknown);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.late_steps);
}

TEST(test_gateway_gap_restarts_after_silence) {
    gateway_rig_run(&rig, MS(1000));
    (void)gateway_rig_request_arm(&rig, HOLDER, false);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.sender.sent.gap_us);
    gateway_rig_run(&rig, MS(50));
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    gateway_rig_arm(&rig);
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_TRUE(rig.gateway.sender.sent.gap_max_us <= 20000U);
    TEST_ASSERT_TRUE(rig.gateway.sender.sent.gap_us > 0);
}

TEST(test_gateway_echo_is_overdue_at_its_limit_exactly) {
    drive_on();
    run_to_next_pair();
    (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
    rig.bus.acknowledged = false;
    const iw_time_us_t overdue_us = rig.bus.last_us[IW_LEFT] + MS(50);
    gateway_rig_run(&rig, overdue_us - 1U - rig.now_us);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    gateway_rig_run(&rig, 1);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_SEND_STALLED, stop()->cause);
    TEST_ASSERT_EQUAL_UINT32(50, stop()->detail);
}

TEST(test_gateway_delayed_zero_is_sent_with_the_first_echo) {
    drive_on();
    rig.bus.echo_delay_us = MS(45);
    run_to_next_pair();
    const iw_time_us_t echo_us = rig.bus.last_us[IW_LEFT] + MS(45);
    gateway_rig_press(&rig, true);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT8(2, rig.bus.unechoed[IW_LEFT]);
    gateway_rig_run(&rig, echo_us - rig.now_us);
    TEST_ASSERT_EQUAL_UINT64(echo_us, rig.bus.last_us[IW_LEFT]);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_zero_to_one_wheel_does_not_count_as_a_pair) {
    drive_on();
    gateway_rig_run(&rig, MS(1));
    rig.bus.acknowledged = false;
    rig.bus.send_result[IW_RIGHT] = 0;
    gateway_rig_press(&rig, true);
    gateway_rig_run(&rig, MS(40));
    const uint32_t pairs = rig.gateway.sender.sent.pairs;
    rig.bus.send_result[IW_RIGHT] = 1;
    gateway_rig_run(&rig, MS(15));
    TEST_ASSERT_EQUAL_UINT8(1, rig.bus.unechoed[IW_RIGHT]);
    TEST_ASSERT_EQUAL_UINT32(pairs, rig.gateway.sender.sent.pairs);
}

TEST(test_gateway_arm_in_the_zero_hold_sends_a_pair_immediately) {
    drive_on();
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(1200));
    run_to_next_pair();
    gateway_rig_run(&rig, rig.bus.last_us[IW_LEFT] + MS(7) - rig.now_us);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, OTHER, false));
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.bus.last_us[IW_LEFT]);
    gateway_rig_run(&rig, MS(1));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_standstill_counts_after_rest_ms_only) {
    turn_both(30);
    gateway_rig_run(&rig, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, gateway_rig_request_arm(&rig, HOLDER, false));
    turn_both(2);
    gateway_rig_run(&rig, MS(198));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(8));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
}

TEST(test_gateway_arm_with_one_moving_wheel_is_refused) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        setUp();
        turn(side, 3);
        gateway_rig_run(&rig, MS(1000));
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, gateway_rig_request_arm(&rig, HOLDER, false));
        tearDown();
    }
}

TEST(test_gateway_hold_lasts_until_500_ms_of_standstill) {
    drive_on();
    gateway_rig_stop(&rig);
    turn_both(5);
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    turn_both(0);
    gateway_rig_run(&rig, MS(495));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    gateway_rig_run(&rig, MS(15));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.permit.still_moving);
}

TEST(test_gateway_hold_ends_after_a_minute_with_a_rolling_wheel) {
    drive_on();
    gateway_rig_stop(&rig);
    turn_both(5);
    gateway_rig_run(&rig, MS(55000));
    TEST_ASSERT_FALSE(gateway_rig_snapshot(&rig).zeros_ending);
    gateway_rig_run(&rig, MS(5200));
    TEST_ASSERT_TRUE(gateway_rig_snapshot(&rig).zeros_ending);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    gateway_rig_run(&rig, MS(150));
    TEST_ASSERT_FALSE(gateway_rig_snapshot(&rig).zeros_ending);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.permit.still_moving);
}

TEST(test_gateway_late_step_continues_the_comparison_of_speeds) {
    gateway_rig_begin_apart(&rig);
    drive_on();
    (void)gateway_rig_cruise(&rig, 120, 120, MS(500));
    turn(IW_RIGHT, -6);
    (void)gateway_rig_cruise(&rig, 120, 120, MS(250));
    stall_by(MS(21)); // The wheel is still online.
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    (void)gateway_rig_cruise(&rig, 120, 120, MS(60));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_FEEDBACK_SIGN, stop()->cause);
}

TEST(test_gateway_wheel_excused_by_a_late_step_is_not_online) {
    gateway_rig_run(&rig, MS(1000));
    stall_by(MS(60));
    rig.wheel[IW_RIGHT].mute = true;
    gateway_rig_run(&rig, MS(10));
    TEST_ASSERT_TRUE(iw_wheel_online(&rig.gateway.wheel[IW_LEFT], rig.now_us));
    TEST_ASSERT_FALSE(iw_wheel_lost(&rig.gateway.wheel[IW_RIGHT], rig.now_us));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_WHEEL_LOST, gateway_rig_request_arm(&rig, HOLDER, false));
}

TEST(test_gateway_step_drains_at_most_its_limit_of_frames) {
    set_mute(true);
    gateway_rig_step(&rig);
    rig.bus.flood = IW_GATEWAY_DRAIN_MAX - 1U;
    gateway_rig_step(&rig);
    TEST_ASSERT_FALSE(rig.gateway.backlog);
    rig.bus.flood = IW_GATEWAY_DRAIN_MAX + 3U;
    gateway_rig_step(&rig);
    TEST_ASSERT_TRUE(rig.gateway.backlog);
    TEST_ASSERT_EQUAL_UINT32(3, rig.bus.flood);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.wake_us);
    gateway_rig_step(&rig);
    TEST_ASSERT_FALSE(rig.gateway.backlog);
    TEST_ASSERT_EQUAL_UINT32(2U * IW_GATEWAY_DRAIN_MAX + 2U, rig.gateway.counters.unknown);
}

TEST(test_gateway_steps_without_elapsed_time_send_nothing) {
    drive_on();
    run_to_next_pair();
    const uint32_t sent = rig.bus.sent;
    for (uint32_t n = 0; n < 100; n++) {
        gateway_rig_step(&rig);
    }
    TEST_ASSERT_EQUAL_UINT32(sent, rig.bus.sent);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}
