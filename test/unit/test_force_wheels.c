// SPDX-License-Identifier: MIT
// Provenance of the force offset with simulated wheels: late join, loaded start, reboot, restart of the gateway, tare.
#include "world_rig.h"

#include "unit.h"

#define SECOND 1000U
/// Zeros of the simulated sensors, as the wheels send them.
#define LEFT_ZERO_mN  12300
#define RIGHT_ZERO_mN 9800

static world_rig_t rig;

void setUp(void) {
    fixture_config(&rig.config);
}

static const iw_force_t *force(iw_side_t side) {
    return &rig.gateway.force[side];
}

static sim_force_t *sensor(iw_side_t side) {
    return &rig.world.pair.wheel[side].force;
}

static iw_force_validity_t validity(iw_side_t side) {
    return iw_force_validity(force(side), rig.now_us);
}

static void load_both(int32_t load_mN) {
    sensor(IW_LEFT)->load_mN = load_mN;
    sensor(IW_RIGHT)->load_mN = load_mN;
}

static void assert_zero(iw_side_t side, iw_offset_provenance_t provenance, int32_t about_mN) {
    TEST_ASSERT_EQUAL_INT(provenance, force(side)->provenance);
    TEST_ASSERT_INT32_WITHIN(300, about_mN, force(side)->offset_mN);
}

static iw_tare_t tare(iw_side_t side) {
    iw_side_t refused = side;
    const iw_tare_t result =
        iw_gateway_tare(&rig.gateway, rig.now_us, (side == IW_LEFT) ? IW_SIDES_LEFT : IW_SIDES_RIGHT, &refused);
    TEST_ASSERT_EQUAL_INT(side, refused);
    return result;
}

static void assert_tare(iw_tare_t expected, iw_side_t side) {
    const iw_force_t before = *force(side);
    const iw_tare_t result = tare(side);
    TEST_ASSERT_EQUAL_INT(expected, result);
    if (expected != IW_TARE_OK) {
        TEST_ASSERT_EQUAL_MEMORY(&before, force(side), sizeof before);
    }
}

TEST(test_force_offset_of_an_unloaded_start_is_used) {
    world_rig_begin(&rig, 0);
    world_rig_run(&rig, 4U * SECOND);
    assert_zero(IW_LEFT, IW_OFFSET_WHEEL, LEFT_ZERO_mN);
    assert_zero(IW_RIGHT, IW_OFFSET_WHEEL, RIGHT_ZERO_mN);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, validity(IW_LEFT));
    load_both(50000);
    world_rig_run(&rig, SECOND);
    TEST_ASSERT_INT32_WITHIN(3500, 50000, iw_force_net_mN(force(IW_LEFT)));
    TEST_ASSERT_INT32_WITHIN(3500, 50000, iw_force_net_mN(force(IW_RIGHT)));
}

TEST(test_force_late_join_without_offset_estimates_in_two_seconds) {
    world_rig_begin(&rig, 100000000U);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_OFFSET, validity(IW_LEFT));
    world_rig_run(&rig, 2U * SECOND);
    assert_zero(IW_LEFT, IW_OFFSET_ESTIMATED, LEFT_ZERO_mN);
    assert_zero(IW_RIGHT, IW_OFFSET_ESTIMATED, RIGHT_ZERO_mN);
    world_rig_run(&rig, 60U * SECOND);
    assert_zero(IW_LEFT, IW_OFFSET_ESTIMATED, LEFT_ZERO_mN);
}

TEST(test_force_late_join_under_load_has_no_offset_until_tare) {
    world_rig_begin(&rig, 100000000U);
    load_both(80000);
    world_rig_restart(&rig);
    world_rig_run(&rig, 5U * SECOND);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, force(IW_LEFT)->provenance);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_NOISY, force(IW_LEFT)->quality.window);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_OFFSET, validity(IW_LEFT));
    assert_tare(IW_TARE_NOISY, IW_LEFT);
    load_both(0);
    world_rig_run(&rig, 3U * SECOND);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_OFFSET, validity(IW_LEFT));
    assert_tare(IW_TARE_OK, IW_LEFT);
    assert_zero(IW_LEFT, IW_OFFSET_OPERATOR, LEFT_ZERO_mN);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, validity(IW_LEFT));
}

/// The gateway is online first: it receives the start of the wheels while a person leans on them.
static void start_loaded_in_sight(void) {
    world_rig_begin(&rig, 0);
    world_rig_run(&rig, 4U * SECOND);
    sim_world_power(&rig.world, rig.now_us, false);
    world_rig_run(&rig, 2U * SECOND);
    world_rig_restart(&rig); // The new gateway has no state of before.
    world_rig_run(&rig, 2U * SECOND);
    load_both(100000);
    sim_world_power(&rig.world, rig.now_us, true);
    world_rig_run(&rig, 4U * SECOND);
}

TEST(test_force_observed_loaded_start_has_no_offset_until_tare) {
    start_loaded_in_sight();
    TEST_ASSERT_TRUE(force(IW_LEFT)->boot_seen && force(IW_LEFT)->wheel_offset_received);
    TEST_ASSERT_INT32_WITHIN(120, 1123, force(IW_LEFT)->wheel_offset_dN); // It includes the weight of the person.
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, force(IW_LEFT)->provenance);
    load_both(0);
    world_rig_run(&rig, 90U * SECOND);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, force(IW_LEFT)->provenance);
    assert_tare(IW_TARE_OK, IW_LEFT);
    assert_zero(IW_LEFT, IW_OFFSET_OPERATOR, LEFT_ZERO_mN);
}

TEST(test_force_unobserved_loaded_start_is_doubted_without_load) {
    world_rig_begin(&rig, 0);
    load_both(50000);
    sim_world_reboot(&rig.world, rig.now_us, IW_LEFT);
    world_rig_run(&rig, 4U * SECOND);
    load_both(0);
    world_rig_restart(&rig);
    world_rig_run(&rig, 4U * SECOND);
    TEST_ASSERT_FALSE(force(IW_LEFT)->boot_seen);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_OFFSET_DOUBTED, validity(IW_LEFT));
    assert_tare(IW_TARE_OK, IW_LEFT);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, validity(IW_LEFT));
}

/// Wheels and gateway share a switch, and a person leans on the machine while it starts.
TEST(test_force_unobserved_loaded_start_retains_the_stored_offset) {
    for (unsigned before_ms = 0; before_ms <= SECOND; before_ms += SECOND) { // The store may answer late.
        world_rig_begin(&rig, 0);
        sim_world_power(&rig.world, rig.now_us, false);
        load_both(150000);
        world_rig_run(&rig, 2U * SECOND);
        sim_world_power(&rig.world, rig.now_us, true);
        world_rig_run(&rig, 10U * SECOND);
        world_rig_restart(&rig);
        world_rig_run(&rig, before_ms);
        TEST_ASSERT_TRUE(before_ms == 0U || force(IW_LEFT)->provenance == IW_OFFSET_WHEEL);
        iw_gateway_restore_offset(&rig.gateway, IW_LEFT, IW_OFFSET_STORED, LEFT_ZERO_mN);
        world_rig_run(&rig, 4U * SECOND);
        TEST_ASSERT_FALSE(force(IW_LEFT)->boot_seen);
        TEST_ASSERT_INT32_WITHIN(120, 1623, force(IW_LEFT)->wheel_offset_dN);
        assert_zero(IW_LEFT, IW_OFFSET_STORED, LEFT_ZERO_mN);
        TEST_ASSERT_INT32_WITHIN(12000, 150000, iw_force_net_mN(force(IW_LEFT)));
        TEST_ASSERT_EQUAL_INT(IW_FORCE_OFFSET_DOUBTED, validity(IW_LEFT));
        TEST_ASSERT_EQUAL_INT(IW_OFFSET_WHEEL, force(IW_RIGHT)->provenance); // Nothing is known that contradicts it.
        load_both(0);
        world_rig_run(&rig, 90U * SECOND);
        assert_zero(IW_LEFT, IW_OFFSET_STORED, LEFT_ZERO_mN);
        TEST_ASSERT_INT32_WITHIN(1000, 0, iw_force_net_mN(force(IW_LEFT)));
        assert_tare(IW_TARE_OK, IW_LEFT);
        TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, validity(IW_LEFT));
    }
}

/// The person has left before the gateway measures: its own mean is good, and the wheel's offset is not.
TEST(test_force_load_that_ended_before_the_gateway_retains_the_stored_offset) {
    static const int32_t loads_mN[] = {12000, 60000, 150000};
    for (size_t i = 0; i < sizeof loads_mN / sizeof loads_mN[0]; i++) {
        world_rig_begin(&rig, 0);
        sim_world_power(&rig.world, rig.now_us, false);
        load_both(loads_mN[i]);
        world_rig_run(&rig, 2U * SECOND);
        sim_world_power(&rig.world, rig.now_us, true);
        world_rig_run(&rig, 10U * SECOND);
        load_both(0);
        world_rig_restart(&rig);
        iw_gateway_restore_offset(&rig.gateway, IW_LEFT, IW_OFFSET_STORED, LEFT_ZERO_mN);
        world_rig_run(&rig, 10U * SECOND);
        TEST_ASSERT_EQUAL_INT(IW_WINDOW_GOOD, force(IW_LEFT)->quality.window);
        assert_zero(IW_LEFT, IW_OFFSET_STORED, LEFT_ZERO_mN);
        TEST_ASSERT_INT32_WITHIN(1000, 0, iw_force_net_mN(force(IW_LEFT)));
        TEST_ASSERT_EQUAL_INT(IW_FORCE_OFFSET_DOUBTED, validity(IW_LEFT));
        assert_tare(IW_TARE_OK, IW_LEFT);
        TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, validity(IW_LEFT));
    }
}

TEST(test_force_unobserved_start_without_load_uses_the_wheels_offset) {
    world_rig_begin(&rig, 0);
    world_rig_run(&rig, 10U * SECOND);
    world_rig_restart(&rig);
    iw_gateway_restore_offset(&rig.gateway, IW_LEFT, IW_OFFSET_STORED, LEFT_ZERO_mN + 4000);
    iw_gateway_restore_offset(&rig.gateway, IW_RIGHT, IW_OFFSET_STORED, RIGHT_ZERO_mN - 4000);
    world_rig_run(&rig, 4U * SECOND);
    assert_zero(IW_LEFT, IW_OFFSET_WHEEL, LEFT_ZERO_mN);
    assert_zero(IW_RIGHT, IW_OFFSET_WHEEL, RIGHT_ZERO_mN);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, validity(IW_LEFT));
}

TEST(test_force_offset_after_reboot_is_stored_then_of_the_wheel) {
    world_rig_begin(&rig, 0);
    world_rig_run(&rig, 90U * SECOND);
    sim_world_power(&rig.world, rig.now_us, false);
    world_rig_run(&rig, 2U * SECOND);
    sim_world_power(&rig.world, rig.now_us, true);
    world_rig_run(&rig, SECOND);
    assert_zero(IW_LEFT, IW_OFFSET_STORED, LEFT_ZERO_mN);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, validity(IW_LEFT));
    world_rig_run(&rig, 4U * SECOND);
    assert_zero(IW_LEFT, IW_OFFSET_WHEEL, LEFT_ZERO_mN);
}

TEST(test_force_reboot_under_load_retains_the_previous_offset) {
    world_rig_begin(&rig, 0);
    world_rig_run(&rig, 90U * SECOND);
    sim_world_power(&rig.world, rig.now_us, false);
    world_rig_run(&rig, 2U * SECOND);
    load_both(10000); // Quiet enough for a zero, if there were no earlier offset.
    sim_world_power(&rig.world, rig.now_us, true);
    world_rig_run(&rig, 20U * SECOND);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_LOADED, force(IW_LEFT)->quality.window);
    assert_zero(IW_LEFT, IW_OFFSET_STORED, LEFT_ZERO_mN);
    TEST_ASSERT_INT32_WITHIN(1000, 10000, iw_force_net_mN(force(IW_LEFT)));
}

TEST(test_force_tare_is_retained_after_reboot_and_restart) {
    world_rig_begin(&rig, 0);
    world_rig_run(&rig, 4U * SECOND);
    assert_tare(IW_TARE_OK, IW_LEFT);
    const int32_t tared_mN = force(IW_LEFT)->offset_mN;
    sim_world_reboot(&rig.world, rig.now_us, IW_LEFT);
    world_rig_run(&rig, 10U * SECOND);
    TEST_ASSERT_EQUAL_INT32(tared_mN, force(IW_LEFT)->offset_mN);
    world_rig_restart(&rig);
    iw_force_restore(&rig.gateway.force[IW_LEFT], IW_OFFSET_OPERATOR, tared_mN);
    load_both(10000);
    world_rig_run(&rig, 10U * SECOND);
    assert_zero(IW_LEFT, IW_OFFSET_OPERATOR, tared_mN);
    TEST_ASSERT_EQUAL_INT32(tared_mN, force(IW_LEFT)->offset_mN);
}

TEST(test_force_tare_is_refused_in_each_unsuitable_condition) {
    world_rig_begin(&rig, 0);
    assert_tare(IW_TARE_NO_FORCE, IW_LEFT);
    world_rig_run(&rig, 4U * SECOND);
    load_both(50000); // The load of a person varies.
    world_rig_run(&rig, 3U * SECOND);
    assert_tare(IW_TARE_NOISY, IW_LEFT);
    load_both(0);
    sensor(IW_LEFT)->sensor_zero_mN += 25000; // Constant weight
    world_rig_run(&rig, 3U * SECOND);
    assert_tare(IW_TARE_LOADED, IW_LEFT);
    assert_tare(IW_TARE_OK, IW_RIGHT);
    sensor(IW_LEFT)->forced_raw = INT16_MAX;
    world_rig_run(&rig, 3U * SECOND);
    assert_tare(IW_TARE_SATURATED, IW_LEFT);
    sensor(IW_LEFT)->forced_raw = SIM_FORCE_AUTO;
    sensor(IW_LEFT)->sensor_zero_mN -= 25000;
    world_rig_run(&rig, 3U * SECOND);
    world_rig_drive(&rig, 200, 0, SECOND);
    assert_tare(IW_TARE_MOVING, IW_LEFT);
    world_rig_run(&rig, 5U * SECOND);
    assert_tare(IW_TARE_OK, IW_LEFT);
    rig.world.pair.wheel[IW_LEFT].muted = true;
    world_rig_run(&rig, SECOND);
    assert_tare(IW_TARE_NO_FORCE, IW_LEFT);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_TELEMETRY, validity(IW_LEFT));
}

TEST(test_force_offset_removed_by_wheel_is_detected_until_tare) {
    world_rig_begin(&rig, 0);
    sensor(IW_LEFT)->zero_removed = true;
    world_rig_restart(&rig);
    world_rig_run(&rig, 4U * SECOND);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_OFFSET_REMOVED, validity(IW_LEFT));
    assert_tare(IW_TARE_OK, IW_LEFT);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, validity(IW_LEFT));
    TEST_ASSERT_INT32_WITHIN(1000, 0, iw_force_net_mN(force(IW_LEFT)));
}
