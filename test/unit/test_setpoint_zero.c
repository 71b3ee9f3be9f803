// SPDX-License-Identifier: MIT
// The pair of zero under either role of the current, the ramps of currents, and the state after a collapse.
#include "setpoint_rig.h"
#include "unit.h"
#include <stdlib.h>

static setpoint_rig_t rig;

void setUp(void) {
    setpoint_rig_init(&rig);
}

TEST(test_setpoint_collapse_is_zero_and_clears_the_command) {
    setpoint_rig_cruise(&rig, 1000, 500, 2000);
    rig.now_us += 1;
    iw_setpoint_collapse(&rig.setpoint, rig.now_us);
    TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&rig.setpoint));
    // Spacing from the last pair, which was sent 1 us ago.
    TEST_ASSERT_FALSE(iw_setpoint_due(&rig.setpoint, rig.now_us + IW_SETPOINT_SPACING_US - 2U));
    (void)setpoint_rig_take_after(&rig, IW_SETPOINT_SPACING_US - 1U);
    TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
    for (uint32_t n = 0; n < 100; n++) {
        (void)setpoint_rig_take_next(&rig);
        TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
    }
    const iw_time_us_t start_us = rig.now_us;
    setpoint_rig_command(&rig, 1000, 1000, 2000);
    const iw_pair_t pair = setpoint_rig_take_next(&rig);
    TEST_ASSERT_INT_WITHIN(1, (int64_t)(rig.now_us - start_us) * 800 / 1000000, pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_TRUE(pair.wheel[IW_LEFT].speed_mm_s > 0);
}

TEST(test_setpoint_command_after_a_collapse_follows_its_zero) {
    setpoint_rig_cruise(&rig, 1000, 500, 2000);
    iw_setpoint_collapse(&rig.setpoint, rig.now_us);
    setpoint_rig_command(&rig, -700, 1000, 2000);
    TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&rig.setpoint));
    (void)setpoint_rig_take_after(&rig, IW_SETPOINT_SPACING_US);
    TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
    TEST_ASSERT_FALSE(iw_setpoint_next_is_zero(&rig.setpoint));
    TEST_ASSERT_TRUE(setpoint_rig_take_next(&rig).wheel[IW_LEFT].speed_mm_s < 0);
}

TEST(test_setpoint_collapse_while_braking_leaves_no_tail) {
    setpoint_rig_cruise(&rig, 1000, 1000, 2000);
    setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
    (void)setpoint_rig_take_next(&rig);
    TEST_ASSERT_FALSE(setpoint_rig_is_zero(&rig));
    iw_setpoint_collapse(&rig.setpoint, rig.now_us);
    (void)setpoint_rig_take_after(&rig, IW_SETPOINT_SPACING_US);
    TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
}

TEST(test_setpoint_zero_with_a_limit_carries_the_maximum_current) {
    rig.config.max_current_mA = 1500;
    setpoint_rig_begin(&rig);
    setpoint_rig_follow(&rig);
    iw_pair_t pair = iw_setpoint_applied(&rig.setpoint);
    for (int side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_INT(0, pair.wheel[side].speed_mm_s);
        TEST_ASSERT_EQUAL_INT(1500, pair.wheel[side].current_mA);
    }
    setpoint_rig_cruise(&rig, 500, 500, 700);
    setpoint_rig_demand(&rig, IW_DEMAND_ZERO);
    pair = setpoint_rig_take_next(&rig);
    TEST_ASSERT_EQUAL_INT(1500, pair.wheel[IW_LEFT].current_mA);
    TEST_ASSERT_EQUAL_INT(1500, pair.wheel[IW_RIGHT].current_mA);
    TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
}

/// A wheel that loses its torque suddenly rolls freely.
TEST(test_setpoint_limit_falls_by_80_mA_in_20_ms) {
    setpoint_rig_follow(&rig);
    const iw_pair_t target = {{{1000, 700}, {1000, 300}}};
    iw_setpoint_command(&rig.setpoint, rig.now_us, &target);
    iw_pair_t pair = setpoint_rig_take_after(&rig, MS(5));
    int32_t expected = 2000 - 20;
    for (uint32_t i = 0; i < 30U; i++) {
        TEST_ASSERT_EQUAL_INT((expected > 700) ? expected : 700, pair.wheel[IW_LEFT].current_mA);
        TEST_ASSERT_EQUAL_INT((expected > 300) ? expected : 300, pair.wheel[IW_RIGHT].current_mA);
        pair = setpoint_rig_take_next(&rig);
        expected -= 80;
    }
}

TEST(test_setpoint_limit_rises_with_the_next_pair) {
    setpoint_rig_cruise(&rig, 1000, 1000, 300);
    TEST_ASSERT_EQUAL_INT(300, iw_setpoint_applied(&rig.setpoint).wheel[IW_RIGHT].current_mA);
    setpoint_rig_command(&rig, 1000, 1000, 900);
    TEST_ASSERT_EQUAL_INT(900, setpoint_rig_take_after(&rig, MS(5)).wheel[IW_RIGHT].current_mA);
    TEST_ASSERT_EQUAL_INT(1000, iw_setpoint_applied(&rig.setpoint).wheel[IW_RIGHT].speed_mm_s);
    setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
    const iw_pair_t pair = setpoint_rig_take_after(&rig, MS(5));
    TEST_ASSERT_EQUAL_INT(2000, pair.wheel[IW_LEFT].current_mA);
    TEST_ASSERT_EQUAL_INT(2000, pair.wheel[IW_RIGHT].current_mA);
}

TEST(test_setpoint_limit_of_a_long_gap_falls_to_its_target) {
    setpoint_rig_follow(&rig);
    setpoint_rig_command(&rig, 1000, 1000, 300);
    TEST_ASSERT_EQUAL_INT(300, setpoint_rig_take_after(&rig, MS(1000000)).wheel[IW_LEFT].current_mA);
}

/// A command before the zero of a collapse does not remove its torque.
TEST(test_setpoint_zero_of_a_collapse_carries_the_maximum_current) {
    setpoint_rig_cruise(&rig, 1000, 1000, 300);
    iw_setpoint_collapse(&rig.setpoint, rig.now_us);
    setpoint_rig_command(&rig, 500, 500, 300);
    const iw_pair_t pair = setpoint_rig_take_after(&rig, MS(5));
    TEST_ASSERT_EQUAL_INT(0, pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(2000, pair.wheel[IW_LEFT].current_mA);
    TEST_ASSERT_EQUAL_INT(2000, pair.wheel[IW_RIGHT].current_mA);
}

TEST(test_setpoint_zero_with_current_as_setpoint_has_no_current) {
    rig.config.current_role = IW_ROLE_SETPOINT;
    setpoint_rig_cruise(&rig, 500, -500, 1200);
    TEST_ASSERT_EQUAL_INT(1200, iw_setpoint_applied(&rig.setpoint).wheel[IW_LEFT].current_mA);
    setpoint_rig_demand(&rig, IW_DEMAND_ZERO);
    const iw_pair_t pair = setpoint_rig_take_next(&rig);
    for (int side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_INT(0, pair.wheel[side].speed_mm_s);
        TEST_ASSERT_EQUAL_INT(0, pair.wheel[side].current_mA);
    }
}

TEST(test_setpoint_current_setpoint_scales_with_the_speed) {
    rig.config.current_role = IW_ROLE_SETPOINT;
    setpoint_rig_follow(&rig);
    setpoint_rig_command(&rig, 1000, -1000, 2000);
    for (uint32_t n = 0; n < 100; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        TEST_ASSERT_INT_WITHIN(4, abs(pair.wheel[IW_LEFT].speed_mm_s) * 2, pair.wheel[IW_LEFT].current_mA);
    }
    setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
    for (uint32_t n = 0; n < 30; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        TEST_ASSERT_INT_WITHIN(4, abs(pair.wheel[IW_LEFT].speed_mm_s) * 2, pair.wheel[IW_LEFT].current_mA);
    }
}

TEST(test_setpoint_current_does_not_overflow_at_extreme_slopes) {
    rig.config.current_role = IW_ROLE_SETPOINT;
    rig.config.max_speed_mm_s = 10;
    rig.config.decel_mm_s2 = 20000;
    setpoint_rig_cruise(&rig, 10, 10, 2000);
    setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
    (void)setpoint_rig_take_after(&rig, MS(2000));
    TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
}

TEST(test_setpoint_current_without_speed_is_not_zero) {
    rig.config.current_role = IW_ROLE_SETPOINT;
    setpoint_rig_follow(&rig);
    setpoint_rig_command(&rig, 0, 0, 2000);
    TEST_ASSERT_INT_WITHIN(1, 8, setpoint_rig_take_next(&rig).wheel[IW_LEFT].current_mA);
    for (uint32_t n = 0; n < 400; n++) {
        (void)setpoint_rig_take_next(&rig);
    }
    TEST_ASSERT_EQUAL_INT(2000, iw_setpoint_applied(&rig.setpoint).wheel[IW_RIGHT].current_mA);
    TEST_ASSERT_FALSE(setpoint_rig_is_zero(&rig));
    setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
    const iw_time_us_t until_us = rig.now_us + 666667U;
    while (rig.now_us < until_us) {
        (void)setpoint_rig_take_next(&rig);
    }
    TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
    TEST_ASSERT_EQUAL_INT(0, iw_setpoint_applied(&rig.setpoint).wheel[IW_RIGHT].current_mA);
}

TEST(test_setpoint_next_is_zero_without_ramp_and_command) {
    static const iw_current_role_t roles[] = {IW_ROLE_LIMIT, IW_ROLE_SETPOINT};
    for (size_t i = 0; i < 2; i++) {
        setUp();
        rig.config.current_role = roles[i];
        setpoint_rig_follow(&rig);
        TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&rig.setpoint));
        setpoint_rig_command(&rig, 1, 0, 0);
        TEST_ASSERT_FALSE(iw_setpoint_next_is_zero(&rig.setpoint));
        setpoint_rig_command(&rig, 0, -1, 0);
        TEST_ASSERT_FALSE(iw_setpoint_next_is_zero(&rig.setpoint));
        setpoint_rig_command(&rig, 0, 0, 1);
        TEST_ASSERT_EQUAL_INT(roles[i] == IW_ROLE_LIMIT, iw_setpoint_next_is_zero(&rig.setpoint));
        const iw_pair_t right_current = {{{0, 0}, {0, 5}}};
        iw_setpoint_command(&rig.setpoint, rig.now_us, &right_current);
        TEST_ASSERT_EQUAL_INT(roles[i] == IW_ROLE_LIMIT, iw_setpoint_next_is_zero(&rig.setpoint));
        const iw_pair_t left_current = {{{0, 5}, {0, 0}}};
        iw_setpoint_command(&rig.setpoint, rig.now_us, &left_current);
        TEST_ASSERT_EQUAL_INT(roles[i] == IW_ROLE_LIMIT, iw_setpoint_next_is_zero(&rig.setpoint));
        setpoint_rig_command(&rig, 0, 600, 0);
        (void)setpoint_rig_take_next(&rig);
        (void)setpoint_rig_take_next(&rig);
        setpoint_rig_command(&rig, 0, 0, 0);
        TEST_ASSERT_FALSE(iw_setpoint_next_is_zero(&rig.setpoint));
        setpoint_rig_demand(&rig, IW_DEMAND_ZERO);
        TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&rig.setpoint));
    }
}

TEST(test_setpoint_current_setpoint_changes_sign_through_zero) {
    rig.config.current_role = IW_ROLE_SETPOINT;
    setpoint_rig_cruise(&rig, 500, 500, 1500);
    setpoint_rig_command(&rig, 500, 500, -1500);
    int32_t before = 1500;
    for (uint32_t n = 0; n < 400; n++) {
        const int32_t current = setpoint_rig_take_next(&rig).wheel[IW_LEFT].current_mA;
        TEST_ASSERT_TRUE(current <= before);
        TEST_ASSERT_TRUE(before * current >= 0);
        before = current;
    }
    TEST_ASSERT_EQUAL_INT(-1500, before);
}
