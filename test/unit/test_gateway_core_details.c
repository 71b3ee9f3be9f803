// SPDX-License-Identifier: MIT
// Details of the rules of the core. Each test kills a mutant that no other test kills.
#include "test_gateway_core_rig.h"
#include "unit.h"

TEST(test_gateway_arm_with_two_pending_on_the_right_is_refused) {
    gateway_rig_run(&rig, MS(1000));
    rig.bus.acknowledged = false;
    rig.bus.send_result[IW_LEFT] = 0;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(25));
    TEST_ASSERT_EQUAL_UINT8(2, rig.bus.unechoed[IW_RIGHT]);
    gateway_rig_stop(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_FALSE(iw_gateway_arming(&rig.gateway));
}

TEST(test_gateway_arm_with_an_excused_wheel_is_refused_as_lost) {
    for (int side = 0; side < IW_SIDES; side++) {
        gateway_rig_init(&rig);
        gateway_rig_run(&rig, MS(1000));
        rig.wheel[side].mute = true;
        stall_by(MS(80));
        rig.now_us += MS(5); // Long enough for telemetry of the other wheel
        gateway_rig_step(&rig);
        TEST_ASSERT_FALSE((rig.gateway.permit.present & (1U << IW_CAUSE_WHEEL_LOST)) != 0U);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_WHEEL_LOST, iw_gateway_arm(&rig.gateway, rig.now_us, HOLDER, false));
    }
}

TEST(test_gateway_setpoints_are_no_telemetry) {
    gateway_rig_run(&rig, MS(1000));
    set_mute(true);
    gateway_rig_run(&rig, MS(100));
    const uint32_t received = rig.gateway.counters.received;
    for (unsigned i = 0; i < 30; i++) { // Longer than a second: the wheels count as offline anyway.
        gateway_rig_foreign(&rig, IW_ID_LEFT_SETPOINT);
        gateway_rig_foreign(&rig, IW_ID_RIGHT_SETPOINT);
        gateway_rig_run(&rig, MS(40));
    }
    TEST_ASSERT_EQUAL_UINT32(received, rig.gateway.counters.received);
    TEST_ASSERT_EQUAL_UINT32(60, rig.gateway.counters.foreign);
    set_mute(false);
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.wheel[IW_LEFT].reboots);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.wheel[IW_RIGHT].reboots);
}

TEST(test_gateway_echo_is_no_telemetry) {
    gateway_rig_arm(&rig);
    set_mute(true);
    const uint32_t received = rig.gateway.counters.received;
    const uint32_t echoes = rig.gateway.counters.echoes;
    gateway_rig_run(&rig, MS(45));
    TEST_ASSERT_TRUE(rig.gateway.counters.echoes > echoes);
    TEST_ASSERT_EQUAL_UINT32(received, rig.gateway.counters.received);
}

TEST(test_gateway_each_invalid_frame_is_counted_once) {
    gateway_rig_run(&rig, MS(1000));
    set_mute(true);
    gateway_rig_run(&rig, MS(10));
    const iw_counters_t before = rig.gateway.counters;
    fake_bus_put_empty(&rig.bus, IW_ID_LEFT_FORCE, 4);
    for (unsigned i = 0; i < 2; i++) {
        fake_bus_put_empty(&rig.bus, IW_ID_LEFT_FORCE | IW_CAN_REMOTE, 4);
    }
    for (unsigned i = 0; i < 3; i++) {
        fake_bus_put_empty(&rig.bus, IW_ID_LEFT_FORCE, 3);
    }
    for (unsigned i = 0; i < 4; i++) {
        fake_bus_put_empty(&rig.bus, 600, 4);
    }
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(before.received + 1U, rig.gateway.counters.received);
    TEST_ASSERT_EQUAL_UINT32(before.bad_format + 2U, rig.gateway.counters.bad_format);
    TEST_ASSERT_EQUAL_UINT32(before.bad_length + 3U, rig.gateway.counters.bad_length);
    TEST_ASSERT_EQUAL_UINT32(before.unknown + 4U, rig.gateway.counters.unknown);
}

TEST(test_gateway_sign_fault_contradicts_with_source_bus) {
    gateway_rig_begin_apart(&rig);
    arm_and_cruise(120, 120, MS(600));
    turn(IW_LEFT, -6);
    (void)gateway_rig_cruise(&rig, 120, 120, MS(500));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_FEEDBACK_SIGN, stop()->cause);
    TEST_ASSERT_TRUE(rig.gateway.permit.seen_us[IW_CAUSE_OVERSPEED] == IW_NEVER); // No other cause
    const iw_assumption_entry_t *const entry = &rig.gateway.assumptions.entry[IW_ASSUMPTION_FEEDBACK_SIGN_LEFT];
    TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, entry->state);
    TEST_ASSERT_EQUAL_INT(IW_SOURCE_BUS, entry->source);
}

TEST(test_gateway_software_estop_names_no_wheel) {
    gateway_rig_arm(&rig);
    iw_gateway_estop(&rig.gateway, rig.now_us, OTHER);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_ESTOP_SOFTWARE, stop()->cause);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_NONE, stop()->sides);
    TEST_ASSERT_EQUAL_UINT32(OTHER, stop()->detail);
    gateway_rig_step(&rig);
}

TEST(test_gateway_arm_repeated_by_the_holder_shifts_no_pair) {
    gateway_rig_arm(&rig);
    gateway_rig_run(&rig, MS(7));
    const iw_time_us_t next_us = iw_setpoint_next_us(&rig.gateway.setpoint);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_arm(&rig.gateway, rig.now_us, HOLDER, false));
    TEST_ASSERT_EQUAL_UINT64(next_us, iw_setpoint_next_us(&rig.gateway.setpoint));
}

TEST(test_gateway_currents_without_flag_are_no_stale_command) {
    const iw_drive_t drive = {{0, 0}, {500, 500}, false};
    iw_applied_t applied;
    rig.config.current_role = IW_ROLE_SETPOINT;
    gateway_rig_begin(&rig, false);
    gateway_rig_run(&rig, MS(1100));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_MISSING_FIELD, iw_gateway_drive(&rig.gateway, rig.now_us, OTHER, &drive, &applied));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
}

TEST(test_gateway_lowest_current_is_the_documented_one) {
    static const int32_t currents[] = {-2000, -2001};
    rig.config.current_role = IW_ROLE_SETPOINT;
    gateway_rig_begin(&rig, false);
    for (size_t i = 0; i < 2; i++) {
        const iw_drive_t drive = {{0, 0}, {currents[i], 0}, true};
        iw_applied_t applied;
        const iw_refusal_t refusal = iw_gateway_drive(&rig.gateway, rig.now_us, HOLDER, &drive, &applied);
        TEST_ASSERT_EQUAL_INT((i == 0U) ? IW_REFUSE_NOT_ARMED : IW_REFUSE_OUT_OF_RANGE, refusal);
    }
}

TEST(test_gateway_pair_refused_on_the_left_is_not_sent_right) {
    arm_and_cruise(300, 300, MS(500));
    gateway_rig_run(&rig, MS(5));
    const iw_time_us_t right_us = rig.bus.last_us[IW_RIGHT];
    rig.bus.send_result[IW_LEFT] = 0;
    for (unsigned i = 0; i < 25U && rig.bus.refused == 0U; i++) {
        gateway_rig_run(&rig, MS(1));
    }
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.refused);
    TEST_ASSERT_EQUAL_UINT64(right_us, rig.bus.last_us[IW_RIGHT]);
    gateway_rig_run(&rig, MS(10));
    TEST_ASSERT_EQUAL_INT16(0, fake_bus_command(&rig.bus.last[IW_RIGHT]).speed_mm_s);
    TEST_ASSERT_TRUE(rig.bus.last_us[IW_RIGHT] > right_us);
}

/// Sends force frames of the left wheel for a little more than two seconds, turning at this speed.
static void receive_force(int16_t raw, int16_t rpm) {
    const message_t message = {IW_CODEC_FORCE, IW_LEFT, {.force = {.force_raw = raw}}};
    turn(IW_LEFT, rpm);
    for (unsigned i = 0; i < IW_FORCE_WINDOW_SAMPLES + 1U; i++) {
        gateway_rig_run(&rig, MS(50));
        put(&message);
    }
    gateway_rig_run(&rig, MS(10));
}

TEST(test_gateway_force_is_measured_up_to_rest_rpm) {
    const int16_t rest_rpm = (int16_t)rig.config.rest_rpm;
    receive_force(100, rest_rpm);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_GOOD, rig.gateway.force[IW_LEFT].quality.window);
    gateway_rig_init(&rig);
    receive_force(100, (int16_t)(rest_rpm + 1));
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_MOVING, rig.gateway.force[IW_LEFT].quality.window);
}

TEST(test_gateway_old_force_observation_does_not_replace_operator) {
    const message_t message = {IW_CODEC_OFFSET, IW_LEFT, {.offset = {.offset_dN = 100}}};
    const iw_assumption_entry_t *const entry = &rig.gateway.assumptions.entry[IW_ASSUMPTION_FORCE_UNIT_LEFT];
    gateway_rig_run(&rig, MS(500));
    put(&message);
    receive_force(100, 0);
    TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, entry->state);
    iw_assumption_confirm(&rig.gateway.assumptions, IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_SOURCE_OPERATOR, 0);
    receive_force(100, 0);
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, entry->state);
}

TEST(test_gateway_wheel_online_after_a_second_is_seen_booting) {
    rig.wheel[IW_LEFT].mute = true;
    gateway_rig_run(&rig, MS(2000));
    rig.wheel[IW_LEFT].mute = false;
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_TRUE(rig.gateway.force[IW_LEFT].boot_seen);
    TEST_ASSERT_FALSE(rig.gateway.force[IW_RIGHT].boot_seen);
}

TEST(test_gateway_offline_wheel_is_not_judged_by_its_old_speed) {
    gateway_rig_begin_apart(&rig);
    arm_and_cruise(120, 120, MS(600));
    turn(IW_LEFT, -6);
    (void)gateway_rig_cruise(&rig, 120, 120, MS(200));
    rig.wheel[IW_LEFT].mute = true;
    stall_by(MS(80));                                 // Excuses the wheel for a short time.
    (void)gateway_rig_cruise(&rig, 120, 120, MS(40)); // Backwards for 300 ms, if it still is.
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    rig.wheel[IW_LEFT].mute = false;
    rig.wheel[IW_LEFT].rpm = 6;
    (void)gateway_rig_cruise(&rig, 120, 120, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

/// Steps just before this time and at it.
static void step_around(iw_time_us_t at_us, const bool *flag) {
    gateway_rig_run(&rig, at_us - 1U - rig.now_us);
    gateway_rig_step(&rig);
    TEST_ASSERT_FALSE(*flag);
    gateway_rig_run(&rig, 1);
    gateway_rig_step(&rig);
    TEST_ASSERT_TRUE(*flag);
}

TEST(test_gateway_at_rest_and_settled_are_exact_to_1_us) {
    gateway_rig_run(&rig, MS(100));
    const iw_time_us_t left_us = rig.gateway.wheel[IW_LEFT].rest_since_us;
    const iw_time_us_t right_us = rig.gateway.wheel[IW_RIGHT].rest_since_us;
    const iw_time_us_t since_us = (left_us > right_us) ? left_us : right_us;
    step_around(since_us + MS(rig.config.rest_ms), &rig.gateway.permit.view.at_rest);
    step_around(since_us + IW_PERMIT_SETTLED_US, &rig.gateway.permit.view.settled);
}
