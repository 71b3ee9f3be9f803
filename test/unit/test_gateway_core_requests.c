// SPDX-License-Identifier: MIT
// Requests of clients, and invalid frames on the bus that have no effect.
#include "test_gateway_core_rig.h"
#include "unit.h"
#include <string.h>

/// Requests a drive without a step; `*out_applied` contains poison before.
static iw_refusal_t ask(const iw_drive_t *request, iw_applied_t *out_applied) {
    memset(out_applied, FIXTURE_POISON, sizeof *out_applied);
    const iw_refusal_t refusal = iw_gateway_drive(&rig.gateway, rig.now_us, HOLDER, request, out_applied);
    if (refusal == IW_REFUSE_NONE) {
        gateway_judge_drive(&rig.judge, true);
    }
    return refusal;
}

static void assert_refused(const iw_drive_t *request, iw_refusal_t expected) {
    const iw_time_us_t lease_us = rig.gateway.permit.lease_until_us;
    const iw_pair_t target = rig.gateway.setpoint.target;
    iw_applied_t applied;
    iw_applied_t poison;
    memset(&poison, FIXTURE_POISON, sizeof poison);
    rig.now_us += 1;
    TEST_ASSERT_EQUAL_INT(expected, ask(request, &applied));
    TEST_ASSERT_EQUAL_MEMORY(&poison, &applied, sizeof poison);
    TEST_ASSERT_EQUAL_UINT64(lease_us, rig.gateway.permit.lease_until_us);
    TEST_ASSERT_EQUAL_MEMORY(&target, &rig.gateway.setpoint.target, sizeof target);
}

static void assert_currents(const iw_drive_t *request, int32_t left_mA, int32_t right_mA, bool limited) {
    iw_applied_t applied;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, ask(request, &applied));
    TEST_ASSERT_EQUAL_INT(left_mA, applied.pair.wheel[IW_LEFT].current_mA);
    TEST_ASSERT_EQUAL_INT(right_mA, applied.pair.wheel[IW_RIGHT].current_mA);
    TEST_ASSERT_EQUAL_INT(limited, applied.limited);
}

/// Begins again with currents as setpoints, and arms.
static void arm_with_current_setpoints(void) {
    rig.config.current_role = IW_ROLE_SETPOINT;
    gateway_rig_begin(&rig, false);
    gateway_rig_arm(&rig);
}

TEST(test_refusal_text_exists_for_every_refusal) {
    static const char *const words[IW_REFUSALS] = {
        [IW_REFUSE_NONE] = "not refused",
        [IW_REFUSE_OUT_OF_RANGE] = "outside its range",
        [IW_REFUSE_MISSING_FIELD] = "no currents",
        [IW_REFUSE_NOT_HOLDER] = "stop it first",
        [IW_REFUSE_BUSY] = "takeover",
        [IW_REFUSE_NOT_ARMED] = "arm first",
        [IW_REFUSE_LATCHED] = "latched",
        [IW_REFUSE_ESTOP_PRESSED] = "e-stop",
        [IW_REFUSE_BUS_DOWN] = "the bus is down",
        [IW_REFUSE_TIMING_MISMATCH] = "sample point",
        [IW_REFUSE_WHEEL_LOST] = "telemetry",
        [IW_REFUSE_WHEEL_BLOCKED] = "did not follow",
        [IW_REFUSE_PAIR_DIVERGES] = "left its path",
        [IW_REFUSE_NOT_AT_REST] = "standstill; wait",
        [IW_REFUSE_SEND_STALLED] = "acknowledged",
        [IW_REFUSE_SECOND_MASTER] = "another device",
        [IW_REFUSE_CAUSE_PRESENT] = "a cause of a stop",
        [IW_REFUSE_TYPE_NOT_SET] = "setpoint_type",
        [IW_REFUSE_TRACK_NOT_SET] = "track_mm",
        [IW_REFUSE_STALE_COMMAND] = "too recently",
        [IW_REFUSE_LISTEN_ONLY] = "listen only",
        [IW_REFUSE_CONTRADICTED] = "contradicts",
    };
    for (int i = 0; i < IW_REFUSALS; i++) {
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(iw_refusal_text((iw_refusal_t)i), words[i]), words[i]);
    }
    TEST_ASSERT_NOT_NULL(strstr(iw_refusal_text(IW_REFUSALS), "no text"));
    TEST_ASSERT_NOT_NULL(strstr(iw_refusal_text((iw_refusal_t)-1), "no text"));
}

TEST(test_gateway_drive_out_of_range_is_refused_completely) {
    static const iw_drive_t requests[] = {{{32768, 0}, {0, 0}, false},        {{0, -32769}, {0, 0}, false},
                                          {{100, INT32_MAX}, {0, 0}, false},  {{INT32_MIN, 100}, {0, 0}, false},
                                          {{100, 100}, {2001, 0}, true},      {{100, 100}, {0, 2001}, true},
                                          {{100, 100}, {-1, 0}, true},        {{100, 100}, {0, -2001}, true},
                                          {{100, 100}, {INT32_MIN, 0}, true}, {{-32769, 32768}, {2001, 2001}, true}};
    gateway_rig_arm(&rig);
    for (size_t i = 0; i < sizeof requests / sizeof requests[0]; i++) {
        assert_refused(&requests[i], IW_REFUSE_OUT_OF_RANGE);
        TEST_ASSERT_EQUAL_UINT32(i + 1U, rig.gateway.counters.out_of_range);
    }
}

TEST(test_gateway_drive_out_of_range_counts_as_stale_command) {
    gateway_rig_run(&rig, MS(1000));
    (void)gateway_rig_drive(&rig, OTHER, 99999, 0);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_STALE_COMMAND, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_EQUAL_INT(OTHER, rig.gateway.permit.stale_client);
    gateway_rig_run(&rig, MS(600));
    const iw_drive_t still = {{0, 0}, {2001, 0}, true};
    assert_refused(&still, IW_REFUSE_OUT_OF_RANGE);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
}

TEST(test_gateway_drive_without_current_requires_the_role_limit) {
    const iw_drive_t request = {{100, -50}, {0, 0}, false};
    iw_applied_t applied;
    rig.config.max_current_mA = 1234;
    gateway_rig_begin(&rig, false);
    gateway_rig_arm(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, ask(&request, &applied));
    TEST_ASSERT_EQUAL_INT(1234, applied.pair.wheel[IW_LEFT].current_mA);
    TEST_ASSERT_EQUAL_INT(1234, applied.pair.wheel[IW_RIGHT].current_mA);
    TEST_ASSERT_EQUAL_INT(100, applied.pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(-50, applied.pair.wheel[IW_RIGHT].speed_mm_s);
    TEST_ASSERT_FALSE(applied.limited);
    arm_with_current_setpoints();
    assert_refused(&request, IW_REFUSE_MISSING_FIELD);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.out_of_range);
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.gateway.permit.stale_client);
}

TEST(test_gateway_negative_current_requires_the_role_setpoint) {
    const iw_drive_t request = {{100, 100}, {-2000, 2000}, true};
    arm_with_current_setpoints();
    assert_currents(&request, -2000, 2000, false);
}

TEST(test_gateway_drive_above_the_maximum_scales_both_wheels) {
    static const struct {
        iw_drive_t request;
        iw_command_t left;
        iw_command_t right;
        bool limited;
    } cases[] = {
        {{{1000, -1000}, {2000, 2000}, true}, {1000, 1000}, {-1000, 1000}, true},
        {{{1000, 500}, {1000, 900}, true}, {1000, 1000}, {500, 900}, false},
        {{{2000, 500}, {1000, 900}, true}, {1000, 1000}, {250, 900}, true},
        {{{-400, 4000}, {1000, 900}, true}, {-100, 1000}, {1000, 900}, true},
        {{{32767, -32768}, {0, 0}, true}, {999, 300}, {-1000, 300}, true},
        {{{100, 100}, {800, 2000}, true}, {100, 400}, {100, 1000}, true},
    };
    rig.config.max_current_mA = 1000;
    rig.config.asymmetric_current = true;
    rig.config.max_yaw_mrad_s = 10000; // This test checks the maximum speed only.
    gateway_rig_begin(&rig, false);
    gateway_rig_arm(&rig);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        iw_applied_t applied;
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, ask(&cases[i].request, &applied));
        TEST_ASSERT_EQUAL_INT16(cases[i].left.speed_mm_s, applied.pair.wheel[IW_LEFT].speed_mm_s);
        TEST_ASSERT_EQUAL_INT16(cases[i].right.speed_mm_s, applied.pair.wheel[IW_RIGHT].speed_mm_s);
        TEST_ASSERT_EQUAL_INT16(cases[i].left.current_mA, applied.pair.wheel[IW_LEFT].current_mA);
        TEST_ASSERT_EQUAL_INT16(cases[i].right.current_mA, applied.pair.wheel[IW_RIGHT].current_mA);
        TEST_ASSERT_EQUAL_INT(cases[i].limited, applied.limited);
    }
}

/// Regression: 0 mA on the left and 2000 mA on the right at speed turned the machine around the left wheel.
TEST(test_gateway_unequal_limits_become_the_larger_one) {
    const iw_drive_t request = {{600, 600}, {0, 2000}, true};
    const iw_drive_t low = {{600, 600}, {0, 299}, true};
    const iw_drive_t equal = {{600, 600}, {500, 500}, true};
    const iw_drive_t zero = {{0, 0}, {500, 500}, true};
    gateway_rig_arm(&rig);
    assert_currents(&request, 2000, 2000, true);
    assert_currents(&low, 300, 300, true);
    assert_currents(&equal, 500, 500, false);
    assert_currents(&zero, 2000, 2000, true);
}

/// A turn around a wheel at standstill is a command of motion, with the limit of the client.
TEST(test_gateway_limit_applies_while_one_wheel_has_speed_zero) {
    static const iw_drive_t requests[] = {{{300, 0}, {500, 500}, true}, {{0, 300}, {500, 500}, true}};
    gateway_rig_arm(&rig);
    for (size_t i = 0; i < 2U; i++) {
        assert_currents(&requests[i], 500, 500, false);
    }
}

/// A current setpoint is not changed: it may be below any floor, unequal, and of either sign.
TEST(test_gateway_current_setpoints_have_no_floor) {
    const iw_drive_t request = {{100, -100}, {5, -400}, true};
    arm_with_current_setpoints();
    assert_currents(&request, 5, -400, false);
}

/// On the bus the limits are never unequal or below the floor, and the ramp to zero has the maximum.
TEST(test_gateway_limit_of_the_client_ends_with_the_stop) {
    const iw_drive_t request = {{600, 600}, {500, 500}, true};
    iw_applied_t applied;
    gateway_rig_arm(&rig);
    for (unsigned i = 0; i < 50U; i++) {
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, ask(&request, &applied));
        gateway_rig_run(&rig, MS(20));
    }
    TEST_ASSERT_EQUAL_INT(500, fake_bus_command(&rig.bus.last[IW_LEFT]).current_mA);
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(6));
    TEST_ASSERT_EQUAL_INT(2000, fake_bus_command(&rig.bus.last[IW_LEFT]).current_mA);
    TEST_ASSERT_EQUAL_INT(2000, fake_bus_command(&rig.bus.last[IW_RIGHT]).current_mA);
    TEST_ASSERT_TRUE(fake_bus_command(&rig.bus.last[IW_RIGHT]).speed_mm_s > 0);
}

TEST(test_gateway_current_alone_is_a_command_as_setpoint_only) {
    const iw_drive_t left = {{0, 0}, {5, 0}, true};
    const iw_drive_t right = {{0, 0}, {0, 5}, true};
    const iw_drive_t neither = {{0, 0}, {0, 0}, true};
    iw_applied_t applied;
    (void)ask(&left, &applied);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, rig.gateway.permit.stale_us);
    rig.config.current_role = IW_ROLE_SETPOINT;
    gateway_rig_begin(&rig, false);
    (void)ask(&neither, &applied);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, rig.gateway.permit.stale_us);
    (void)ask(&left, &applied);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.gateway.permit.stale_us);
    rig.now_us += 1;
    (void)ask(&right, &applied);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.gateway.permit.stale_us);
}

TEST(test_gateway_lost_lease_and_disconnect_ramp) {
    arm_and_cruise(400, 400, MS(1000));
    gateway_rig_run(&rig, MS(160));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LEASE_LOST, stop()->cause);
    setUp();
    arm_and_cruise(400, 400, MS(1000));
    iw_gateway_disconnect(&rig.gateway, rig.now_us, HOLDER);
    gateway_rig_run(&rig, MS(60));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_GONE, stop()->cause);
    TEST_ASSERT_TRUE(rig.bus.commanded_mm_s[IW_LEFT] < 400 && rig.bus.commanded_mm_s[IW_LEFT] > 250);
}

TEST(test_gateway_takeover_is_granted_at_standstill_only) {
    arm_and_cruise(400, 400, MS(500));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_BUSY, gateway_rig_request_arm(&rig, OTHER, false));
    TEST_ASSERT_TRUE(gateway_rig_request_arm(&rig, OTHER, true) != IW_REFUSE_NONE);
    (void)gateway_rig_cruise(&rig, 0, 0, MS(1500));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, OTHER, true));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_HOLDER, gateway_rig_drive(&rig, HOLDER, 100, 100));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_drive(&rig, OTHER, 100, 100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_contradicted_timing_refuses_arm) {
    const iw_bus_facts_t bad = {true, true};
    const iw_bus_facts_t good = {false, true};
    iw_gateway_bus_facts(&rig.gateway, &bad);
    gateway_rig_run(&rig, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_TIMING_MISMATCH, gateway_rig_request_arm(&rig, HOLDER, false));
    iw_gateway_bus_facts(&rig.gateway, &good);
    gateway_rig_run(&rig, MS(20));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_TRUE(rig.gateway.facts.echo_proven);
}

TEST(test_gateway_arm_in_the_zero_hold_continues_without_gap) {
    arm_and_cruise(200, 200, MS(500));
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(900));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, OTHER, false));
    gateway_rig_run(&rig, MS(10));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_frames_of_bad_format_refresh_nothing) {
    static const uint32_t flags[] = {IW_CAN_REMOTE, IW_CAN_EXTENDED, IW_CAN_ERROR, IW_CAN_FD};
    gateway_rig_arm(&rig);
    rig.wheel[IW_LEFT].mute = true;
    for (uint32_t n = 0; n < 20; n++) {
        fake_bus_put_empty(&rig.bus, IW_ID_LEFT_SPEED | flags[n % 4U], 4);
        fake_bus_put_empty(&rig.bus, IW_ID_LEFT_SETPOINT | flags[n % 4U], 5);
        gateway_rig_run(&rig, MS(4));
    }
    TEST_ASSERT_EQUAL_UINT32(40, rig.gateway.counters.bad_format);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.foreign);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, stop()->cause);
}

TEST(test_gateway_short_frames_refresh_nothing_long_ones_do) {
    gateway_rig_arm(&rig);
    rig.wheel[IW_LEFT].mute = true;
    for (uint32_t n = 0; n < 50; n++) {
        fake_bus_put_empty(&rig.bus, IW_ID_LEFT_SPEED, 8);
        gateway_rig_run(&rig, MS(4));
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    for (uint32_t n = 0; n < 20; n++) {
        fake_bus_put_empty(&rig.bus, IW_ID_LEFT_SPEED, 3);
        fake_bus_put_empty(&rig.bus, IW_ID_LEFT_SPEED, 9);
        gateway_rig_run(&rig, MS(4));
    }
    TEST_ASSERT_EQUAL_UINT32(40, rig.gateway.counters.bad_length);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, stop()->cause);
}

TEST(test_gateway_unknown_ids_are_counted_without_effect) {
    gateway_rig_arm(&rig);
    const uint32_t received = rig.gateway.counters.received;
    fake_bus_put_empty(&rig.bus, 0x266, 5);
    fake_bus_put_empty(&rig.bus, 0x7FF, 8);
    fake_bus_put_empty(&rig.bus, 0, 0);
    fake_bus_put_empty(&rig.bus, 0x1FFFFFFFU | IW_CAN_EXTENDED, 8);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(4, rig.gateway.counters.unknown);
    TEST_ASSERT_UINT32_WITHIN(2, received, rig.gateway.counters.received);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_stray_echo_does_not_confirm_arm) {
    gateway_rig_run(&rig, MS(1000));
    rig.bus.acknowledged = false;
    iw_can_frame_t echo = {.id = IW_ID_LEFT_SETPOINT, .dlc = 5, .kind = IW_CAN_ECHO};
    fake_bus_put(&rig.bus, &echo);
    echo.id = IW_ID_RIGHT_SETPOINT;
    fake_bus_put(&rig.bus, &echo);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(2, rig.gateway.sender.confirmation.stray);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.foreign);
    (void)gateway_rig_request_arm(&rig, HOLDER, false);
    gateway_rig_run(&rig, MS(60));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
}

TEST(test_gateway_refused_arm_does_not_change_the_pending_arm) {
    gateway_rig_run(&rig, MS(1000));
    rig.bus.acknowledged = false;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(7));
    TEST_ASSERT_TRUE(iw_gateway_arming(&rig.gateway));
    const iw_time_us_t due_us = iw_setpoint_next_us(&rig.gateway.setpoint);
    TEST_ASSERT_TRUE(due_us > rig.now_us);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_BUSY, iw_gateway_arm(&rig.gateway, rig.now_us, OTHER, true));
    TEST_ASSERT_EQUAL_UINT64(due_us, iw_setpoint_next_us(&rig.gateway.setpoint));
}

TEST(test_gateway_shutdown_ramps) {
    arm_and_cruise(400, 400, MS(1000));
    iw_gateway_stop(&rig.gateway, rig.now_us, IW_CLIENT_NONE, IW_CAUSE_SHUTDOWN);
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_SHUTDOWN, stop()->cause);
    TEST_ASSERT_FALSE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_release_ends_zeros_only_after_the_ramp) {
    rig.config.hold = true;
    gateway_rig_begin(&rig, false);
    gateway_rig_run(&rig, MS(1000));
    arm_and_cruise(400, 400, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, iw_gateway_release(&rig.gateway));
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(60000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_release(&rig.gateway));
    gateway_rig_run(&rig, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
}
