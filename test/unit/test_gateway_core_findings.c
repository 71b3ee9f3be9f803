// SPDX-License-Identifier: MIT
// Observations of the wheels without motion: units, offsets, lengths, pose, reboots.
#include "test_gateway_core_rig.h"
#include "unit.h"

static const iw_assumption_entry_t *entry(iw_assumption_item_t item) {
    return &rig.gateway.assumptions.entry[item];
}

static void assert_entry(iw_assumption_item_t item, iw_assumption_state_t state, iw_source_t source) {
    TEST_ASSERT_EQUAL_INT(state, entry(item)->state);
    TEST_ASSERT_EQUAL_INT(source, entry(item)->source);
}

static void put_offset(iw_side_t side, int16_t offset_dN) {
    const message_t message = {IW_CODEC_OFFSET, side, {.offset = {offset_dN}}};
    put(&message);
}

/// Sends force frames of this value every 50 ms for this time.
static void press_for(iw_side_t side, int16_t raw, iw_time_us_t for_us) {
    const message_t message = {IW_CODEC_FORCE, side, {.force = {.force_raw = raw}}};
    const iw_time_us_t until_us = rig.now_us + for_us;
    while (rig.now_us < until_us) {
        put(&message);
        gateway_rig_run(&rig, MS(50));
    }
}

/// Makes a quiet start with this raw value, then an offset of 10 N from the wheel.
static void start_with(iw_side_t side, int16_t raw) {
    gateway_rig_run(&rig, MS(20));
    press_for(side, raw, MS(2100));
    put_offset(side, 100);
    gateway_rig_step(&rig);
}

TEST(test_gateway_init_sets_the_sources_of_the_assumptions) {
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_ASSUMED, IW_SOURCE_CONFIGURATION);
    assert_entry(IW_ASSUMPTION_CURRENT_ROLE, IW_ASSUMED, IW_SOURCE_CONFIGURATION);
    assert_entry(IW_ASSUMPTION_TRACK, IW_ASSUMED, IW_SOURCE_CONFIGURATION);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_ASSUMED, IW_SOURCE_DOCUMENT);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_ASSUMED, IW_SOURCE_DOCUMENT);
    rig.config.setpoint_type_set = false;
    rig.config.track_mm = 0;
    rig.config.current_role = IW_ROLE_UNSET;
    rig.config.force_unit[IW_LEFT] = IW_FORCE_DN;
    rig.config.force_unit[IW_RIGHT] = IW_FORCE_CN;
    gateway_rig_begin(&rig, false);
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_ASSUMED, IW_SOURCE_NONE);
    assert_entry(IW_ASSUMPTION_CURRENT_ROLE, IW_ASSUMED, IW_SOURCE_NONE);
    assert_entry(IW_ASSUMPTION_TRACK, IW_ASSUMED, IW_SOURCE_NONE);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_ASSUMED, IW_SOURCE_CONFIGURATION);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_ASSUMED, IW_SOURCE_CONFIGURATION);
}

TEST(test_gateway_quiet_start_confirms_the_unit_of_each_side) {
    start_with(IW_LEFT, 1000);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_CONFIRMED, IW_SOURCE_BUS);
    assert_entry(IW_ASSUMPTION_OFFSET_INCLUDED, IW_CONFIRMED, IW_SOURCE_BUS);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_ASSUMED, IW_SOURCE_DOCUMENT);
    TEST_ASSERT_EQUAL_INT32(10000, entry(IW_ASSUMPTION_FORCE_UNIT_LEFT)->figure);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_WHEEL, rig.gateway.force[IW_LEFT].provenance);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, iw_force_validity(&rig.gateway.force[IW_LEFT], rig.now_us));
    start_with(IW_RIGHT, 100);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_CONFIRMED, IW_SOURCE_BUS);
    TEST_ASSERT_EQUAL_INT32(1000, entry(IW_ASSUMPTION_FORCE_UNIT_RIGHT)->figure);
    const uint32_t changes = rig.gateway.assumptions.changes;
    press_for(IW_RIGHT, 100, MS(500));
    TEST_ASSERT_EQUAL_UINT32(changes, rig.gateway.assumptions.changes);
}

TEST(test_gateway_wrong_unit_is_contradicted_and_force_invalid) {
    start_with(IW_LEFT, 100);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_CONTRADICTED, IW_SOURCE_BUS);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_UNIT_CONTRADICTED, iw_force_validity(&rig.gateway.force[IW_LEFT], rig.now_us));
    start_with(IW_RIGHT, 1000);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_CONTRADICTED, IW_SOURCE_BUS);
    assert_entry(IW_ASSUMPTION_OFFSET_INCLUDED, IW_ASSUMED, IW_SOURCE_DOCUMENT);
}

TEST(test_gateway_removed_offset_is_contradicted) {
    start_with(IW_RIGHT, 0);
    assert_entry(IW_ASSUMPTION_OFFSET_INCLUDED, IW_CONTRADICTED, IW_SOURCE_BUS);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_ASSUMED, IW_SOURCE_DOCUMENT);
}

TEST(test_gateway_unclear_unit_changes_no_assumption) {
    start_with(IW_LEFT, 500);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, rig.gateway.force[IW_LEFT].observation);
    assert_entry(IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_ASSUMED, IW_SOURCE_DOCUMENT);
    assert_entry(IW_ASSUMPTION_OFFSET_INCLUDED, IW_ASSUMED, IW_SOURCE_DOCUMENT);
}

TEST(test_gateway_turning_wheel_contaminates_its_own_window_only) {
    turn(IW_LEFT, 3);
    gateway_rig_run(&rig, MS(20));
    press_for(IW_LEFT, 1000, MS(2100));
    press_for(IW_RIGHT, 100, MS(2100));
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_MOVING, rig.gateway.force[IW_LEFT].quality.window);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_GOOD, rig.gateway.force[IW_RIGHT].quality.window);
}

TEST(test_gateway_force_without_speed_frames_counts_as_standstill) {
    rig.wheel[IW_LEFT].mute = true;
    press_for(IW_LEFT, 1000, MS(2100));
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_GOOD, rig.gateway.force[IW_LEFT].quality.window);
}

TEST(test_gateway_stall_does_not_contaminate_the_force_window) {
    gateway_rig_run(&rig, MS(20));
    press_for(IW_LEFT, 1000, MS(1000));
    gateway_rig_stall(&rig, MS(90));
    press_for(IW_LEFT, 1000, MS(1200));
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_GOOD, rig.gateway.force[IW_LEFT].quality.window);
}

static iw_tare_t tare(iw_side_t side) {
    iw_side_t refused = side;
    const iw_tare_t result =
        iw_gateway_tare(&rig.gateway, rig.now_us, (side == IW_LEFT) ? IW_SIDES_LEFT : IW_SIDES_RIGHT, &refused);
    TEST_ASSERT_EQUAL_INT(side, refused);
    return result;
}

TEST(test_gateway_tare_of_both_refused_for_one_changes_neither) {
    iw_side_t refused = IW_LEFT;
    gateway_rig_run(&rig, MS(20));
    press_for(IW_LEFT, 700, MS(2100));
    const iw_force_t before = rig.gateway.force[IW_LEFT];
    TEST_ASSERT_EQUAL_INT(IW_TARE_NO_FORCE, iw_gateway_tare(&rig.gateway, rig.now_us, IW_SIDES_BOTH, &refused));
    TEST_ASSERT_EQUAL_INT(IW_RIGHT, refused);
    TEST_ASSERT_EQUAL_MEMORY(&before, &rig.gateway.force[IW_LEFT], sizeof before);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, iw_gateway_tare(&rig.gateway, rig.now_us, IW_SIDES_NONE, &refused));
    TEST_ASSERT_EQUAL_MEMORY(&before, &rig.gateway.force[IW_LEFT], sizeof before);
}

TEST(test_gateway_tare_sets_the_present_force_to_zero) {
    TEST_ASSERT_EQUAL_INT(IW_TARE_NO_FORCE, tare(IW_RIGHT));
    gateway_rig_run(&rig, MS(20));
    press_for(IW_RIGHT, 70, MS(2100));
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, tare(IW_RIGHT));
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_OPERATOR, rig.gateway.force[IW_RIGHT].provenance);
    TEST_ASSERT_EQUAL_INT32(7000, rig.gateway.force[IW_RIGHT].offset_mN);
    TEST_ASSERT_EQUAL_INT32(0, iw_force_net_mN(&rig.gateway.force[IW_RIGHT]));
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, rig.gateway.force[IW_LEFT].provenance);
}

TEST(test_gateway_tare_of_both_names_the_refusing_left_wheel) {
    iw_side_t refused = IW_RIGHT;
    gateway_rig_run(&rig, MS(20));
    press_for(IW_RIGHT, 70, MS(2100));
    turn(IW_LEFT, 10);
    press_for(IW_LEFT, 700, MS(2100));
    const iw_force_t before = rig.gateway.force[IW_RIGHT];
    TEST_ASSERT_EQUAL_INT(IW_TARE_MOVING, iw_gateway_tare(&rig.gateway, rig.now_us, IW_SIDES_BOTH, &refused));
    TEST_ASSERT_EQUAL_INT(IW_LEFT, refused);
    TEST_ASSERT_EQUAL_MEMORY(&before, &rig.gateway.force[IW_RIGHT], sizeof before);
}

TEST(test_gateway_tare_of_the_left_wheel_sets_its_offset) {
    gateway_rig_run(&rig, MS(20));
    press_for(IW_LEFT, 700, MS(2100));
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, tare(IW_LEFT));
    TEST_ASSERT_EQUAL_INT32(7000, rig.gateway.force[IW_LEFT].offset_mN);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_OPERATOR, rig.gateway.force[IW_LEFT].provenance);
}

TEST(test_gateway_restored_offset_applies_to_its_wheel_only) {
    iw_gateway_restore_offset(&rig.gateway, IW_RIGHT, IW_OFFSET_STORED, -1234);
    TEST_ASSERT_EQUAL_INT32(-1234, rig.gateway.force[IW_RIGHT].offset_mN);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_STORED, rig.gateway.force[IW_RIGHT].provenance);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, rig.gateway.force[IW_LEFT].provenance);
}

TEST(test_gateway_rebooted_wheel_reopens_its_force_window) {
    start_with(IW_LEFT, 1000);
    rig.wheel[IW_LEFT].mute = true;
    gateway_rig_run(&rig, MS(1500));
    rig.wheel[IW_LEFT].mute = false;
    gateway_rig_run(&rig, MS(20));
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_STORED, rig.gateway.force[IW_LEFT].provenance);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_OPEN, rig.gateway.force[IW_LEFT].quality.window);
    TEST_ASSERT_TRUE(rig.gateway.force[IW_LEFT].boot_seen);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_OPEN, rig.gateway.force[IW_RIGHT].quality.window);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_CAUSE_PRESENT, gateway_rig_request_arm(&rig, HOLDER, false));
    TEST_ASSERT_EQUAL_HEX32(1U << IW_CAUSE_WHEEL_REBOOTED, iw_permit_present(&rig.gateway.permit, rig.now_us));
}

TEST(test_gateway_status_length_sets_the_dlc_assumption) {
    assert_entry(IW_ASSUMPTION_DLC, IW_ASSUMED, IW_SOURCE_NONE);
    gateway_rig_run(&rig, MS(50));
    assert_entry(IW_ASSUMPTION_DLC, IW_CONFIRMED, IW_SOURCE_BUS);
    TEST_ASSERT_EQUAL_INT32(7, entry(IW_ASSUMPTION_DLC)->figure);
    fake_bus_put_empty(&rig.bus, IW_ID_RIGHT_STATUS, 8);
    gateway_rig_step(&rig);
    assert_entry(IW_ASSUMPTION_DLC, IW_CONTRADICTED, IW_SOURCE_BUS);
    TEST_ASSERT_EQUAL_INT32(8, entry(IW_ASSUMPTION_DLC)->figure);
}

TEST(test_gateway_pose_is_stored_with_its_time) {
    const message_t message = {IW_CODEC_POSE, IW_RIGHT, {.pose = {-1, 2, -3, 31415}}};
    gateway_rig_run(&rig, MS(100)); // Speed and status frames are no poses.
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, rig.gateway.pose_us);
    rig.now_us += 1; // At a time without other frames
    put(&message);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.gateway.pose_us);
    TEST_ASSERT_EQUAL_INT(-1, rig.gateway.telemetry[IW_RIGHT].pose.x_mm);
    TEST_ASSERT_EQUAL_INT(31415, rig.gateway.telemetry[IW_RIGHT].pose.psi_mrad);
}

TEST(test_gateway_driving_confirms_the_feedback_sign_once) {
    arm_and_cruise(200, -200, MS(300));
    assert_entry(IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_ASSUMED, entry(IW_ASSUMPTION_FEEDBACK_SIGN_LEFT)->source);
    (void)gateway_rig_cruise(&rig, 200, -200, MS(1200));
    assert_entry(IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_CONFIRMED, IW_SOURCE_BUS);
    assert_entry(IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT, IW_CONFIRMED, IW_SOURCE_BUS);
    assert_entry(IW_ASSUMPTION_MOUNT_SIGN_LEFT, IW_ASSUMED, entry(IW_ASSUMPTION_MOUNT_SIGN_LEFT)->source);
    TEST_ASSERT_GREATER_THAN_INT32(100, entry(IW_ASSUMPTION_FEEDBACK_SIGN_LEFT)->figure);
    TEST_ASSERT_GREATER_THAN_INT32(100, entry(IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT)->figure); // As with a positive command
    const uint32_t changes = rig.gateway.assumptions.changes;
    (void)gateway_rig_cruise(&rig, 250, -250, MS(1500)); // Faster, and still slower than the yaw limit permits
    TEST_ASSERT_EQUAL_INT32(241, rig.gateway.diverge.measured_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT32(changes, rig.gateway.assumptions.changes);
}

TEST(test_gateway_current_that_must_be_clamped_is_counted) {
    gateway_rig_arm(&rig);
    rig.gateway.config.max_current_mA = 3000;
    const uint32_t sent = rig.bus.sent;
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(50));
    TEST_ASSERT_TRUE(rig.bus.sent > sent);
    TEST_ASSERT_EQUAL_UINT32(rig.bus.sent - sent, rig.gateway.sender.sent.clamped);
    TEST_ASSERT_EQUAL_INT(2000, fake_bus_command(&rig.bus.last[IW_LEFT]).current_mA);
}

TEST(test_gateway_right_frame_stopped_by_envelope_stops_left_too) {
    arm_and_cruise(100, 400, MS(1000));
    rig.gateway.config.max_speed_mm_s = 200;
    gateway_rig_run(&rig, MS(20));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_INTERNAL, stop()->cause);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}
