// SPDX-License-Identifier: MIT
// Conclusions from the motion of wheels: the core with the simulated pair in virtual time, and wheels that differ from
// the assumptions.
#include "world_rig.h"

#include "unit.h"

static world_rig_t rig;

void setUp(void) {
    fixture_config(&rig.config);
    world_rig_begin(&rig, 0);
}

static void assert_entry(iw_assumption_item_t item, iw_assumption_state_t state) {
    const iw_assumption_entry_t *entry = &rig.gateway.assumptions.entry[item];
    TEST_ASSERT_EQUAL_INT(state, entry->state);
    if (state != IW_ASSUMED) {
        TEST_ASSERT_EQUAL_INT(IW_SOURCE_BUS, entry->source);
    }
}

static int32_t figure(iw_assumption_item_t item) {
    return rig.gateway.assumptions.entry[item].figure;
}

TEST(test_observation_wheels_at_standstill_judge_no_assumption) {
    world_rig_run(&rig, 60000);
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, IW_ASSUMED);
    assert_entry(IW_ASSUMPTION_POSE_BYTE_ORDER, IW_ASSUMED);
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_ASSUMED);
}

TEST(test_observation_wheels_driving_confirm_ratio_pose_and_type) {
    world_rig_drive(&rig, 400, -400, 6000);
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED);
    TEST_ASSERT_INT32_WITHIN(60, 1000, figure(IW_ASSUMPTION_GEAR_RATIO));
    assert_entry(IW_ASSUMPTION_POSE_BYTE_ORDER, IW_CONFIRMED);
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_CONFIRMED);
    TEST_ASSERT_INT32_WITHIN(60, 1000, figure(IW_ASSUMPTION_SETPOINT_TYPE));
    assert_entry(IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_CONFIRMED);
    assert_entry(IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT, IW_CONFIRMED);
    assert_entry(IW_ASSUMPTION_MOUNT_SIGN_LEFT, IW_ASSUMED);
    assert_entry(IW_ASSUMPTION_WHEEL_RADIUS, IW_ASSUMED);
    assert_entry(IW_ASSUMPTION_CURRENT_ROLE, IW_ASSUMED);
}

TEST(test_observation_wheels_at_120_mm_s_confirm_no_ratio_or_type) {
    world_rig_drive(&rig, 120, 120, 20000);
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, IW_ASSUMED);
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_ASSUMED);
}

static void set_gear(uint16_t turns, bool rpm_of_rotor) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        rig.world.pair.wheel[side].motion.config.gear_turns = turns;
        rig.world.pair.wheel[side].motion.config.rpm_of_rotor = rpm_of_rotor;
    }
}

TEST(test_observation_wheels_with_another_gear_contradict_ratio) {
    set_gear(3, false);
    world_rig_drive(&rig, 300, 300, 16000);
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, IW_CONTRADICTED);
    TEST_ASSERT_INT32_WITHIN(200, 3000, figure(IW_ASSUMPTION_GEAR_RATIO));
}

TEST(test_observation_wheels_confirm_gear_of_rotor_or_wheel_rpm) {
    rig.config.gear_turns = 3;
    world_rig_begin(&rig, 0);
    set_gear(3, false);
    world_rig_drive(&rig, 300, 300, 8000);
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED);
    rig.config.rpm_of_rotor = true;
    world_rig_begin(&rig, 0);
    set_gear(3, true);
    world_rig_drive(&rig, 300, 300, 8000);
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED);
}

TEST(test_observation_wheels_rotor_rpm_as_wheel_rpm_contradicts) {
    rig.config.gear_turns = 2;
    rig.config.follow_mm_s = 500;
    world_rig_begin(&rig, 0);
    set_gear(2, true);
    world_rig_drive(&rig, 300, 300, 12000);
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, IW_CONTRADICTED);
    TEST_ASSERT_INT32_WITHIN(60, 500, figure(IW_ASSUMPTION_GEAR_RATIO));
}

TEST(test_observation_wheels_one_bad_stretch_changes_no_verdict) {
    world_rig_drive(&rig, 400, 400, 4000);
    const iw_assumption_entry_t before = rig.gateway.assumptions.entry[IW_ASSUMPTION_GEAR_RATIO];
    rig.gateway.wheel[IW_LEFT].ticks += 70;
    world_rig_drive(&rig, 400, 400, 8000);
    TEST_ASSERT_EQUAL_INT(before.state, rig.gateway.assumptions.entry[IW_ASSUMPTION_GEAR_RATIO].state);
}

TEST(test_observation_wheels_isolated_bad_stretches_confirm_ratio) {
    for (unsigned times = 0; times < 5U; times++) {
        rig.gateway.wheel[IW_LEFT].ticks += 70;
        world_rig_drive(&rig, 400, 400, 12000);
    }
    assert_entry(IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED);
}

TEST(test_observation_wheels_changing_speeds_do_not_confirm_type) {
    world_rig_drive(&rig, 300, 300, 100);
    for (unsigned times = 0; times < 40U; times++) {
        const int32_t mm_s = (times % 2U == 0U) ? 330 : 300;
        world_rig_drive(&rig, mm_s, mm_s, 200);
    }
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_ASSUMED);
}

TEST(test_observation_wheels_reboot_or_gap_contradicts_no_ratio) {
    world_rig_drive(&rig, 400, 400, 3000);
    for (unsigned times = 0; times < 4U; times++) {
        sim_world_reboot(&rig.world, rig.now_us, IW_LEFT);
        world_rig_run(&rig, 1000);
        rig.world.pair.wheel[IW_LEFT].motion.ticks += (times % 2U == 0U) ? 100000U : 0U;
        world_rig_run(&rig, 2000);
        (void)iw_gateway_reset(&rig.gateway, rig.now_us);
        world_rig_run(&rig, 8000);
        (void)iw_gateway_reset(&rig.gateway, rig.now_us);
        world_rig_drive(&rig, 400, 400, 3000);
    }
    TEST_ASSERT_NOT_EQUAL(IW_CONTRADICTED, rig.gateway.assumptions.entry[IW_ASSUMPTION_GEAR_RATIO].state);
    TEST_ASSERT_EQUAL_UINT32(4, rig.gateway.wheel[IW_LEFT].reboots);
}

TEST(test_observation_wheels_reversed_pose_contradicts_byte_order) {
    rig.world.pair.pose_reversed = true;
    world_rig_drive(&rig, 300, 350, 4000);
    assert_entry(IW_ASSUMPTION_POSE_BYTE_ORDER, IW_CONTRADICTED);
    TEST_ASSERT_LESS_THAN_INT32(200, figure(IW_ASSUMPTION_POSE_BYTE_ORDER));
}

TEST(test_observation_wheels_pose_that_jumps_once_stays_confirmed) {
    world_rig_drive(&rig, 300, 350, 2000);
    assert_entry(IW_ASSUMPTION_POSE_BYTE_ORDER, IW_CONFIRMED);
    sim_world_reboot(&rig.world, rig.now_us, IW_RIGHT);
    world_rig_run(&rig, 12000);
    assert_entry(IW_ASSUMPTION_POSE_BYTE_ORDER, IW_CONFIRMED);
}

TEST(test_observation_wheels_blocked_do_not_confirm_the_type) {
    rig.world.pair.wheel[IW_LEFT].motion.blocked = true;
    rig.world.pair.wheel[IW_RIGHT].motion.blocked = true;
    world_rig_drive(&rig, 300, 300, 4000);
    assert_entry(IW_ASSUMPTION_SETPOINT_TYPE, IW_ASSUMED);
}

TEST(test_observation_wheels_do_not_replace_the_operator_source) {
    iw_assumption_confirm(&rig.gateway.assumptions, IW_ASSUMPTION_GEAR_RATIO, IW_SOURCE_OPERATOR, 0);
    iw_assumption_contradict(&rig.gateway.assumptions, IW_ASSUMPTION_POSE_BYTE_ORDER, IW_SOURCE_OPERATOR, 0);
    world_rig_drive(&rig, 400, 400, 5000);
    TEST_ASSERT_EQUAL_INT(IW_SOURCE_OPERATOR, rig.gateway.assumptions.entry[IW_ASSUMPTION_GEAR_RATIO].source);
    TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, rig.gateway.assumptions.entry[IW_ASSUMPTION_POSE_BYTE_ORDER].state);
}
