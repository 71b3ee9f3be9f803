// SPDX-License-Identifier: MIT
// From init to ARMED: silence, the pair of arm and its echo, listen-only, start after a crash.
#include "test_gateway_core_rig.h"
#include "unit.h"
#include <string.h>

TEST(test_gateway_init_refuses_bad_configuration_without_change) {
    static uint8_t poison[sizeof(iw_gateway_t)];
    const iw_hal_t hal = fake_bus_hal(&rig.bus);
    memset(&rig.gateway, FIXTURE_POISON, sizeof rig.gateway);
    memset(poison, FIXTURE_POISON, sizeof poison);
    rig.config.lease_ms = 0;
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_LEASE, iw_gateway_init(&rig.gateway, &rig.config, &hal, rig.now_us, false));
    TEST_ASSERT_EQUAL_MEMORY(poison, &rig.gateway, sizeof poison);
}

TEST(test_gateway_listening_sends_nothing) {
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.sent + rig.bus.refused);
    TEST_ASSERT_TRUE(rig.gateway.counters.received > 1400);
}

TEST(test_gateway_copies_its_configuration) {
    rig.config.listen_only = true;
    rig.config.max_speed_mm_s = 10;
    drive_on();
}

TEST(test_gateway_arm_sends_a_zero_pair_and_waits_for_its_echo) {
    gateway_rig_run(&rig, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_EQUAL_UINT32(2, rig.bus.sent);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    TEST_ASSERT_EQUAL_INT16(2000, fake_bus_command(&rig.bus.last[IW_LEFT]).current_mA);
    TEST_ASSERT_TRUE(iw_gateway_arming(&rig.gateway));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    gateway_rig_run(&rig, 300 + FAKE_BUS_FRAME_US - 1);
    TEST_ASSERT_TRUE(iw_gateway_arming(&rig.gateway));
    gateway_rig_run(&rig, 1);
    TEST_ASSERT_FALSE(iw_gateway_arming(&rig.gateway));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_EQUAL_UINT32(2, rig.gateway.counters.echoes);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_arm_requires_both_echoes) {
    gateway_rig_run(&rig, MS(1000));
    rig.bus.send_result[IW_RIGHT] = 0;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(60));
    TEST_ASSERT_FALSE(iw_gateway_arming(&rig.gateway));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, iw_gateway_arm_refusal(&rig.gateway));
}

TEST(test_gateway_arm_without_echo_is_send_stalled_then_silent) {
    gateway_rig_run(&rig, MS(1000));
    rig.bus.acknowledged = false;
    (void)gateway_rig_request_arm(&rig, HOLDER, false);
    gateway_rig_run(&rig, MS(60));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, iw_gateway_arm_refusal(&rig.gateway));
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    const uint32_t sent = rig.bus.sent;
    gateway_rig_run(&rig, MS(2000));
    TEST_ASSERT_EQUAL_UINT32(sent, rig.bus.sent);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, gateway_rig_request_arm(&rig, HOLDER, false));
    rig.bus.acknowledged = true;
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
}

TEST(test_gateway_arm_with_two_pending_on_the_left_is_refused) {
    gateway_rig_run(&rig, MS(1000));
    rig.bus.acknowledged = false;
    rig.bus.send_result[IW_RIGHT] = 0;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(25));
    TEST_ASSERT_EQUAL_UINT8(2, rig.bus.unechoed[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT8(0, rig.bus.unechoed[IW_RIGHT]);
    gateway_rig_stop(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_FALSE(iw_gateway_arming(&rig.gateway));
}

TEST(test_gateway_listen_only_never_sends) {
    rig.config.listen_only = true;
    for (int restarted = 0; restarted < 2; restarted++) {
        gateway_rig_begin(&rig, restarted != 0);
        gateway_rig_run(&rig, MS(1100));
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_LISTEN_ONLY, gateway_rig_request_arm(&rig, HOLDER, false));
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_LISTEN_ONLY, gateway_rig_drive(&rig, HOLDER, 100, 100));
        gateway_rig_foreign(&rig, 266);
        gateway_rig_press(&rig, true);
        gateway_rig_run(&rig, MS(2000));
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
        TEST_ASSERT_EQUAL_UINT32(0, rig.bus.sent + rig.bus.refused);
    }
}

TEST(test_gateway_restarted_sends_zeros_then_listens) {
    gateway_rig_begin(&rig, true);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(2, rig.bus.sent);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    gateway_rig_run(&rig, MS(1499));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    gateway_rig_run(&rig, MS(2));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_UINT32_WITHIN(4, 150, rig.bus.sent);
    TEST_ASSERT_EQUAL_UINT32(0, rig.judge.moving_frames);
}

TEST(test_gateway_restarted_without_track_sends_zeros_never_arms) {
    rig.config.track_mm = 0;
    gateway_rig_begin(&rig, true);
    turn(IW_LEFT, 40);
    gateway_rig_run(&rig, MS(1400));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_UINT32_WITHIN(4, 140, rig.bus.sent);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    rig.wheel[IW_LEFT].rpm = 0;
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_TRACK_NOT_SET, gateway_rig_request_arm(&rig, HOLDER, true));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, gateway_rig_drive(&rig, HOLDER, 100, 100));
    TEST_ASSERT_EQUAL_UINT32(0, rig.judge.moving_frames);
}

TEST(test_gateway_restarted_gives_way_to_another_master) {
    gateway_rig_begin(&rig, true);
    gateway_rig_run(&rig, MS(10));
    for (unsigned i = 0; i < 4; i++) {
        gateway_rig_foreign(&rig, 298);
        gateway_rig_step(&rig);
        TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    }
    const uint32_t sent = rig.bus.sent;
    gateway_rig_foreign(&rig, 298);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    gateway_rig_run(&rig, MS(2000));
    TEST_ASSERT_EQUAL_UINT32(sent, rig.bus.sent);
}

TEST(test_gateway_restarted_without_type_sends_nothing) {
    rig.config.setpoint_type_set = false;
    gateway_rig_begin(&rig, true);
    gateway_rig_run(&rig, MS(2000));
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.sent + rig.bus.refused);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
}
