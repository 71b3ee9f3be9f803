// SPDX-License-Identifier: MIT
// Setpoints: what is sent and when, and the effect if it cannot be sent.
#include "test_gateway_core_rig.h"
#include "unit.h"

TEST(test_gateway_armed_sends_zero_pairs_until_the_first_drive) {
    gateway_rig_arm(&rig);
    gateway_rig_run(&rig, MS(900));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_EQUAL_UINT32(0, rig.judge.moving_frames);
    TEST_ASSERT_UINT32_WITHIN(4, 2 * 46, rig.bus.sent);
}

TEST(test_gateway_period_is_exact_and_both_frames_sent_together) {
    drive_on();
    iw_time_us_t last_us = rig.bus.last_us[IW_LEFT];
    for (uint32_t n = 0; n < 40; n++) {
        (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
        while (rig.bus.last_us[IW_LEFT] == last_us) {
            gateway_rig_run(&rig, 100);
        }
        TEST_ASSERT_EQUAL_UINT64(last_us + MS(20), rig.bus.last_us[IW_LEFT]);
        TEST_ASSERT_EQUAL_UINT64(rig.bus.last_us[IW_LEFT], rig.bus.last_us[IW_RIGHT]);
        last_us = rig.bus.last_us[IW_LEFT];
    }
    TEST_ASSERT_EQUAL_UINT32(20000, rig.gateway.sender.sent.gap_us);
    TEST_ASSERT_EQUAL_UINT32(20000, rig.gateway.sender.sent.gap_max_us);
}

TEST(test_gateway_changed_command_is_sent_in_the_same_step) {
    drive_on();
    (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
    gateway_rig_run(&rig, rig.bus.last_us[IW_LEFT] + MS(27) - rig.now_us);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_drive(&rig, HOLDER, 100, 100));
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.bus.last_us[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.bus.last_us[IW_RIGHT]);
}

TEST(test_gateway_pair_waits_for_the_echoes_of_both_wheels) {
    drive_on();
    rig.bus.echo_delay_us = MS(8);
    gateway_rig_run(&rig, rig.bus.last_us[IW_LEFT] + MS(20) - rig.now_us);
    const iw_time_us_t sent_us = rig.bus.last_us[IW_LEFT];
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, sent_us);
    (void)gateway_rig_drive(&rig, HOLDER, 300, 300);
    gateway_rig_run(&rig, MS(8));
    TEST_ASSERT_EQUAL_UINT8(0, rig.gateway.sender.confirmation.pending[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT64(sent_us, rig.bus.last_us[IW_LEFT]);
    gateway_rig_run(&rig, FAKE_BUS_FRAME_US);
    TEST_ASSERT_EQUAL_UINT64(sent_us + MS(8) + FAKE_BUS_FRAME_US, rig.bus.last_us[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT64(sent_us + MS(8) + FAKE_BUS_FRAME_US, rig.bus.last_us[IW_RIGHT]);
}

TEST(test_gateway_zeros_are_sent_to_each_wheel_that_accepts) {
    drive_on();
    rig.bus.echo_delay_us = MS(30);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(100));
    gateway_rig_press(&rig, true);
    iw_time_us_t seen_us[IW_SIDES] = {rig.now_us, rig.now_us};
    for (uint32_t n = 0; n < 5000; n++) {
        gateway_rig_run(&rig, 100);
        for (size_t side = 0; side < IW_SIDES; side++) {
            seen_us[side] = (rig.bus.last_us[side] > seen_us[side]) ? rig.bus.last_us[side] : seen_us[side];
            TEST_ASSERT_TRUE(rig.now_us - seen_us[side] < MS(60));
        }
    }
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    TEST_ASSERT_EQUAL_INT(0, rig.bus.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(0, rig.bus.commanded_mm_s[IW_RIGHT]);
}

TEST(test_gateway_zero_for_right_does_not_wait_for_left) {
    drive_on();
    gateway_rig_run(&rig, MS(1));
    rig.bus.acknowledged = false;
    rig.bus.send_result[IW_RIGHT] = 0;
    gateway_rig_press(&rig, true);
    gateway_rig_run(&rig, MS(40));
    TEST_ASSERT_EQUAL_UINT8(2, rig.bus.unechoed[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT8(0, rig.bus.unechoed[IW_RIGHT]);
    rig.bus.send_result[IW_RIGHT] = 1;
    gateway_rig_run(&rig, MS(6));
    TEST_ASSERT_EQUAL_UINT8(2, rig.bus.unechoed[IW_LEFT]);
    TEST_ASSERT_TRUE(rig.bus.unechoed[IW_RIGHT] > 0);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_inverted_wheel_receives_the_negated_speed) {
    rig.config.invert[IW_RIGHT] = true;
    gateway_rig_begin(&rig, false);
    arm_and_cruise(300, 300, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_EQUAL_INT(300, rig.bus.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(-300, rig.bus.commanded_mm_s[IW_RIGHT]);
    TEST_ASSERT_EQUAL_INT(2000, fake_bus_command(&rig.bus.last[IW_RIGHT]).current_mA);
}

TEST(test_gateway_inverted_wheel_receives_the_negated_current) {
    rig.config.invert[IW_LEFT] = true;
    rig.config.current_role = IW_ROLE_SETPOINT;
    gateway_rig_begin(&rig, false);
    arm_and_cruise(300, 300, MS(1000));
    TEST_ASSERT_EQUAL_INT(-300, rig.bus.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(-150, fake_bus_command(&rig.bus.last[IW_LEFT]).current_mA);
    TEST_ASSERT_EQUAL_INT(150, fake_bus_command(&rig.bus.last[IW_RIGHT]).current_mA);
}

TEST(test_gateway_pair_refused_for_one_wheel_is_followed_by_zeros) {
    for (int side = 0; side < IW_SIDES; side++) {
        setUp();
        drive_on();
        rig.bus.send_result[side] = (side == IW_LEFT) ? 0 : -1;
        (void)gateway_rig_drive(&rig, HOLDER, 400, 400);
        const uint32_t refused = rig.bus.refused;
        while (rig.bus.refused == refused) {
            gateway_rig_run(&rig, 100);
        }
        rig.bus.send_result[side] = 1;
        gateway_rig_run(&rig, MS(6));
        TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
        TEST_ASSERT_TRUE(rig.gateway.sender.sent.later > 0);
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
        (void)gateway_rig_cruise(&rig, 100, 100, MS(300));
        TEST_ASSERT_EQUAL_INT(100, rig.bus.commanded_mm_s[side]);
        tearDown();
    }
}

TEST(test_gateway_drives_again_after_a_port_refused_every_send) {
    drive_on();
    rig.bus.send_result[IW_LEFT] = 0;
    rig.bus.send_result[IW_RIGHT] = 0;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(120));
    gateway_rig_run(&rig, MS(62000)); // Longer than the longest hold
    TEST_ASSERT_FALSE(rig.gateway.permit.phase == IW_PHASE_CUT);
    rig.bus.send_result[IW_LEFT] = 1;
    rig.bus.send_result[IW_RIGHT] = 1;
    gateway_rig_run(&rig, MS(1100));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_reset(&rig));
    gateway_rig_arm(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_pair_that_is_never_sent_is_a_stalled_send) {
    drive_on();
    rig.bus.send_result[IW_RIGHT] = 0;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(120));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_SEND_STALLED, stop()->cause);
    TEST_ASSERT_EQUAL_INT(0, fake_bus_command(&rig.bus.last[IW_LEFT]).speed_mm_s);
}

TEST(test_gateway_late_echo_within_the_limit_does_not_stop) {
    rig.bus.echo_delay_us = MS(30);
    gateway_rig_arm(&rig);
    gateway_rig_run(&rig, MS(60));
    (void)gateway_rig_cruise(&rig, 400, 400, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_EQUAL_INT(400, rig.bus.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.sender.envelope.stopped);
}

TEST(test_gateway_bus_down_in_motion_latches_and_sends_zero_first) {
    static const iw_bus_state_t states[] = {IW_BUS_DOWN, IW_BUS_OFF};
    for (size_t i = 0; i < 2; i++) {
        setUp();
        drive_on();
        const uint32_t sent = rig.bus.sent;
        fake_bus_break(&rig.bus, states[i]);
        gateway_rig_step(&rig);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
        TEST_ASSERT_EQUAL_INT(IW_CAUSE_BUS_DOWN, stop()->cause);
        TEST_ASSERT_EQUAL_UINT32(states[i], stop()->detail);
        gateway_rig_run(&rig, MS(300));
        TEST_ASSERT_EQUAL_UINT32(sent, rig.bus.sent);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_BUS_DOWN, gateway_rig_reset(&rig));
        rig.bus.state = IW_BUS_ACTIVE;
        gateway_rig_step(&rig);
        TEST_ASSERT_EQUAL_UINT32(sent + 2U, rig.bus.sent);
        TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
        gateway_rig_run(&rig, MS(3000));
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
        tearDown();
    }
}

TEST(test_gateway_error_passive_bus_allows_motion) {
    rig.bus.state = IW_BUS_PASSIVE;
    drive_on();
    TEST_ASSERT_EQUAL_INT(IW_BUS_PASSIVE, rig.gateway.bus);
}

TEST(test_gateway_stop_ramps_then_holds_zeros_then_is_silent) {
    drive_on();
    gateway_rig_stop(&rig);
    const iw_time_us_t stop_us = rig.now_us;
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    gateway_rig_run(&rig, MS(150));
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
    gateway_rig_run(&rig, MS(150));
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    gateway_rig_run(&rig, MS(1400));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    gateway_rig_run(&rig, MS(400));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    const iw_time_us_t zeros_us = rig.bus.last_us[IW_LEFT] - stop_us;
    TEST_ASSERT_TRUE(zeros_us > MS(1700) && zeros_us < MS(1840));
    const uint32_t sent = rig.bus.sent;
    gateway_rig_run(&rig, MS(5000));
    TEST_ASSERT_EQUAL_UINT32(sent, rig.bus.sent);
}
