// SPDX-License-Identifier: MIT
// How fast the pair may turn the machine: limits of commands, growth in a ramp, and no delay of a stop.
#include "setpoint_rig.h"
#include "unit.h"

#include <stdlib.h>

static setpoint_rig_t rig;

void setUp(void) {
    setpoint_rig_init(&rig);
    fixture_config(&rig.config);
    setpoint_rig_begin(&rig);
}

static int32_t turn_of(const iw_pair_t *pair) {
    return pair->wheel[IW_RIGHT].speed_mm_s - pair->wheel[IW_LEFT].speed_mm_s;
}

TEST(test_yaw_bounds_match_the_real_machine) {
    static const struct {
        uint16_t max_mrad_s, accel_mrad_s2, track_mm, radius_mm;
        int32_t most_mm_s;
        uint32_t growth_mm_s2;
    } cases[] = {
        {1000, 2000, 540, 192, 540, 1080},
        {1000, 2000, 540, 60, 1728, 3456},
        {1000, 2000, 540, 400, 259, 518},
        {50, 100, 200, 500, 3, 7},
        {10000, 10000, 1500, 60, 48000, 48000},
        {10000, 10000, 1500, 20, 144000, 144000},
        {10000, 10000, 0, 60, 0, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rig.config.max_yaw_mrad_s = cases[i].max_mrad_s;
        rig.config.yaw_accel_mrad_s2 = cases[i].accel_mrad_s2;
        rig.config.track_mm = cases[i].track_mm;
        rig.config.radius_mm = cases[i].radius_mm;
        setpoint_rig_begin(&rig);
        TEST_ASSERT_EQUAL_INT32(cases[i].most_mm_s, rig.setpoint.yaw.most_mm_s);
        TEST_ASSERT_EQUAL_UINT32(cases[i].growth_mm_s2, rig.setpoint.yaw.growth_mm_s2);
    }
}

TEST(test_yaw_limit_scales_both_wheels_by_one_factor) {
    static const struct {
        int32_t asked[IW_SIDES];
        int32_t applied[IW_SIDES];
        bool limited;
    } cases[] = {
        {{-270, 270}, {-270, 270}, false},
        {{-271, 270}, {-270, 269}, true},
        {{270, -270}, {270, -270}, false},
        {{270, -271}, {269, -270}, true},
        {{1000, 1000}, {1000, 1000}, false},
        {{0, 540}, {0, 540}, false},
        {{0, 541}, {0, 540}, true},
        {{541, 0}, {540, 0}, true},
        {{0, -541}, {0, -540}, true},
        {{1000, 100}, {600, 60}, true},
        {{-100, -1000}, {-60, -600}, true},
        {{32767, -32768}, {269, -270}, true},
        {{-32768, 32767}, {-270, 269}, true},
        {{-32768, -32768}, {-32768, -32768}, false},
        {{0, 0}, {0, 0}, false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        int32_t speeds[IW_SIDES] = {cases[i].asked[IW_LEFT], cases[i].asked[IW_RIGHT]};
        TEST_ASSERT_EQUAL_INT(cases[i].limited, iw_yaw_limit(&rig.setpoint.yaw, speeds));
        TEST_ASSERT_EQUAL_INT32_ARRAY(cases[i].applied, speeds, IW_SIDES);
    }
}

TEST(test_yaw_limit_never_increases_or_reverses_a_speed) {
    fixture_random_t random;
    fixture_random_init(&random, 21);
    for (uint32_t n = 0; n < 200000; n++) {
        const iw_yaw_t yaw = {fixture_random_in(&random, 1, 3000), 1};
        const int32_t asked[IW_SIDES] = {fixture_random_in(&random, -32768, 32767),
                                         (n % 7U == 0U) ? 0 : fixture_random_in(&random, -32768, 32767)};
        int32_t speeds[IW_SIDES] = {asked[IW_LEFT], asked[IW_RIGHT]};
        (void)iw_yaw_limit(&yaw, speeds);
        TEST_ASSERT_TRUE(abs(speeds[IW_RIGHT] - speeds[IW_LEFT]) <= yaw.most_mm_s);
        for (int side = 0; side < IW_SIDES; side++) {
            TEST_ASSERT_TRUE(abs(speeds[side]) <= abs(asked[side]));
            TEST_ASSERT_TRUE(speeds[side] == 0 || (speeds[side] < 0) == (asked[side] < 0));
        }
        const int64_t skew = (int64_t)speeds[0] * asked[1] - (int64_t)speeds[1] * asked[0];
        TEST_ASSERT_TRUE(llabs(skew) <= 2 * 32768);
    }
}

TEST(test_yaw_bound_is_the_growth_up_to_the_limit) {
    static const struct {
        int32_t from;
        uint32_t growth;
        int32_t bound;
    } cases[] = {{0, 21600, 21600},       {5000, 1000, 6000},      {0, 0, 0},
                 {530000, 9999, 539999},  {530000, 10000, 540000}, {530000, 10001, 540000},
                 {540000, 21600, 540000}, {550000, 21600, 550000}, {550000, 0, 550000}};
    const iw_yaw_t yaw = {540, 1080};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        TEST_ASSERT_EQUAL_INT32(cases[i].bound, iw_yaw_bound(&yaw, cases[i].from, cases[i].growth));
        TEST_ASSERT_EQUAL_INT32(cases[i].bound, iw_yaw_bound(&yaw, -cases[i].from, cases[i].growth));
    }
}

/// 2 um/s are reserved for the rounding of both wheels.
TEST(test_yaw_room_is_the_margin_on_the_side_of_the_change) {
    static const struct {
        int32_t bound, from, change;
        uint32_t margin;
    } cases[] = {{21600, 0, 21601, 21598}, {6000, 5000, 3000, 998},    {6000, -5000, 12000, 10998},
                 {6000, 6000, 1, 0},       {6000, 5998, 100, 0},       {6000, 5997, 100, 1},
                 {6000, 5999, 100, 0},     {540000, 0, 600000, 539998}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        TEST_ASSERT_EQUAL_UINT32(cases[i].margin, iw_yaw_margin(cases[i].bound, cases[i].from, cases[i].change));
        TEST_ASSERT_EQUAL_UINT32(cases[i].margin, iw_yaw_margin(cases[i].bound, -cases[i].from, -cases[i].change));
    }
}

TEST(test_yaw_grows_by_its_acceleration_to_its_target) {
    setpoint_rig_follow(&rig);
    const iw_time_us_t start_us = rig.now_us;
    setpoint_rig_command(&rig, -270, 270, 2000);
    for (uint32_t n = 0; n < 40; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        const int64_t ideal = (int64_t)(rig.now_us - start_us) * 1080 / 1000000;
        TEST_ASSERT_INT_WITHIN(2, (ideal > 540) ? 540 : ideal, turn_of(&pair));
        TEST_ASSERT_EQUAL_INT(pair.wheel[IW_RIGHT].speed_mm_s, -pair.wheel[IW_LEFT].speed_mm_s);
    }
    TEST_ASSERT_EQUAL_INT(-270, iw_setpoint_applied(&rig.setpoint).wheel[IW_LEFT].speed_mm_s);
}

TEST(test_yaw_late_call_grows_for_two_periods_at_most) {
    setpoint_rig_follow(&rig);
    setpoint_rig_command(&rig, -270, 270, 2000);
    const iw_pair_t pair = setpoint_rig_take_after(&rig, 500000);
    TEST_ASSERT_INT_WITHIN(1, 42, turn_of(&pair));
}

TEST(test_yaw_of_a_faster_curve_retains_the_curve) {
    setpoint_rig_follow(&rig);
    setpoint_rig_command(&rig, 300, 840, 2000);
    for (uint32_t n = 0; n < 100; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        TEST_ASSERT_INT_WITHIN(1, pair.wheel[IW_RIGHT].speed_mm_s * 300 / 840, pair.wheel[IW_LEFT].speed_mm_s);
    }
    TEST_ASSERT_EQUAL_INT(840, iw_setpoint_applied(&rig.setpoint).wheel[IW_RIGHT].speed_mm_s);
}

/// A single wheel that slows down turns the machine: this is growth of yaw, too.
TEST(test_yaw_growth_by_one_braking_wheel_is_bounded) {
    setpoint_rig_cruise(&rig, 900, 900, 2000);
    const iw_time_us_t start_us = rig.setpoint.last_us;
    setpoint_rig_command(&rig, 400, 900, 2000);
    for (uint32_t n = 0; n < 40; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        const int64_t ideal = (int64_t)(rig.now_us - start_us) * 1080 / 1000000;
        TEST_ASSERT_INT_WITHIN(2, (ideal > 500) ? 500 : ideal, turn_of(&pair));
        TEST_ASSERT_EQUAL_INT(900, pair.wheel[IW_RIGHT].speed_mm_s);
    }
    TEST_ASSERT_EQUAL_INT(400, iw_setpoint_applied(&rig.setpoint).wheel[IW_LEFT].speed_mm_s);
}

/// From 0/0 to 64 mm/s of the right wheel, which it could reach in one step: growth of 1000 mm/s2 allows 20 mm/s. A
/// current that is a setpoint changes by the same share.
TEST(test_yaw_that_delays_a_speed_delays_its_current) {
    static const iw_pair_t target = {{{0, 0}, {64, 640}}};
    rig.config.track_mm = 500;
    rig.config.accel_mm_s2 = 20000;
    rig.config.current_role = IW_ROLE_SETPOINT;
    setpoint_rig_begin(&rig);
    setpoint_rig_follow(&rig);
    iw_setpoint_command(&rig.setpoint, rig.now_us, &target);
    const iw_pair_t pair = setpoint_rig_take_after(&rig, 20002); // 2 um/s are for the rounding.
    TEST_ASSERT_EQUAL_INT(20, pair.wheel[IW_RIGHT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(200, pair.wheel[IW_RIGHT].current_mA);
    TEST_ASSERT_EQUAL_INT(0, pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(0, pair.wheel[IW_LEFT].current_mA);
}

/// The same for a wheel that brakes: its current decreases by the same share as its speed.
TEST(test_yaw_that_delays_braking_delays_its_current) {
    static const iw_pair_t target = {{{400, 400}, {900, 900}}};
    rig.config.current_role = IW_ROLE_SETPOINT;
    rig.config.max_current_mA = 1000;
    setpoint_rig_begin(&rig);
    setpoint_rig_cruise(&rig, 900, 900, 900);
    iw_setpoint_command(&rig.setpoint, rig.now_us, &target);
    for (uint32_t n = 0; n < 40; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        TEST_ASSERT_INT_WITHIN(1, pair.wheel[IW_LEFT].speed_mm_s, pair.wheel[IW_LEFT].current_mA);
        TEST_ASSERT_EQUAL_INT(900, pair.wheel[IW_RIGHT].current_mA);
    }
    TEST_ASSERT_EQUAL_INT(400, iw_setpoint_applied(&rig.setpoint).wheel[IW_LEFT].current_mA);
}

/// Braking that alone leads exactly to the bound is not delayed: only the wheel that would become faster waits.
TEST(test_yaw_braking_up_to_its_bound_is_not_delayed) {
    rig.config.track_mm = 500;
    rig.config.max_yaw_mrad_s = 2000;
    rig.config.decel_mm_s2 = 1000;
    setpoint_rig_begin(&rig);
    setpoint_rig_cruise(&rig, 900, 900, 2000);
    setpoint_rig_command(&rig, 388, 1000, 2000);
    (void)setpoint_rig_take_after(&rig, 20000);
    TEST_ASSERT_EQUAL_INT32(880000, rig.setpoint.speed_um_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT32(900000, rig.setpoint.speed_um_s[IW_RIGHT]);
}

/// Only the slope towards zero applies: in a stop, at a command of 0/0, and where yaw decreases.
TEST(test_yaw_delays_no_stop_and_no_decrease) {
    static const struct {
        bool command;
        int16_t left_mm_s, right_mm_s;
    } ends[] = {{false, 0, 0}, {true, 0, 0}, {true, -20, 20}, {true, 20, -20}};
    rig.config.yaw_accel_mrad_s2 = 200;
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        setpoint_rig_begin(&rig);
        setpoint_rig_cruise(&rig, -270, 270, 2000);
        const iw_time_us_t start_us = rig.setpoint.last_us;
        if (ends[i].command) {
            setpoint_rig_command(&rig, ends[i].left_mm_s, ends[i].right_mm_s, 2000);
        } else {
            setpoint_rig_demand(&rig, IW_DEMAND_BRAKE);
        }
        const int32_t least = (ends[i].right_mm_s > 0) ? ends[i].right_mm_s : 0;
        for (uint32_t n = 0; n < 10; n++) {
            const iw_pair_t pair = setpoint_rig_take_next(&rig);
            const int64_t ideal = 270 - (int64_t)(rig.now_us - start_us) * 1500 / 1000000;
            if (ideal > 0) {
                TEST_ASSERT_INT_WITHIN(1, (ideal < least) ? least : ideal, pair.wheel[IW_RIGHT].speed_mm_s);
            }
        }
    }
}

/// From any curve, 0/0 is reached as early as the slope of the faster wheel allows, however slowly yaw may grow.
TEST(test_yaw_delays_no_stop_from_any_curve) {
    static const int16_t curves[][IW_SIDES] = {{300, 800},   {800, 300},   {-270, 270}, {0, 540},
                                               {-700, -701}, {1000, 1000}, {-100, 400}};
    static const iw_current_role_t roles[] = {IW_ROLE_LIMIT, IW_ROLE_SETPOINT};
    for (size_t i = 0; i < 2 * sizeof curves / sizeof curves[0]; i++) {
        const int32_t left = curves[i / 2U][IW_LEFT];
        const int32_t right = curves[i / 2U][IW_RIGHT];
        const int32_t most = (abs(left) > abs(right)) ? abs(left) : abs(right);
        rig.config.current_role = roles[i % 2U];
        setpoint_rig_begin(&rig);
        setpoint_rig_cruise(&rig, (int16_t)left, (int16_t)right, 0);
        rig.setpoint.yaw.growth_mm_s2 = 1;
        const iw_time_us_t start_us = rig.setpoint.last_us;
        setpoint_rig_command(&rig, 0, 0, 0);
        do {
            const iw_pair_t pair = setpoint_rig_take_next(&rig);
            const int32_t ideal = most - (int32_t)((rig.now_us - start_us) * 1500U / 1000000U);
            const int32_t rest = (ideal > 0) ? ideal : 0;
            TEST_ASSERT_INT_WITHIN(1, rest * left / most, pair.wheel[IW_LEFT].speed_mm_s);
            TEST_ASSERT_INT_WITHIN(1, rest * right / most, pair.wheel[IW_RIGHT].speed_mm_s);
        } while (rig.now_us - start_us < 700000U);
        TEST_ASSERT_TRUE(setpoint_rig_is_zero(&rig));
    }
}

/// One wheel brakes for a long time through zero. The other could become faster immediately: it waits, and both reach
/// the target.
TEST(test_yaw_at_its_limit_waits_and_reaches_the_target) {
    rig.config.max_yaw_mrad_s = 278; // 150 mm/s.
    rig.config.accel_mm_s2 = 20000;
    rig.config.decel_mm_s2 = 100;
    rig.config.max_speed_mm_s = 60;
    setpoint_rig_begin(&rig);
    setpoint_rig_cruise(&rig, 50, -100, 2000);
    setpoint_rig_command(&rig, -1000, -1000, 2000);
    for (uint32_t n = 0; n < 400; n++) {
        const iw_pair_t pair = setpoint_rig_take_next(&rig);
        TEST_ASSERT_TRUE(abs(turn_of(&pair)) <= 150);
    }
    TEST_ASSERT_EQUAL_INT(-1000, iw_setpoint_applied(&rig.setpoint).wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(-1000, iw_setpoint_applied(&rig.setpoint).wheel[IW_RIGHT].speed_mm_s);
}

static void draw_config(fixture_random_t *random) {
    rig.config.max_yaw_mrad_s = (uint16_t)fixture_random_in(random, 50, 3000);
    rig.config.yaw_accel_mrad_s2 = (uint16_t)fixture_random_in(random, 100, 10000);
    rig.config.track_mm = (uint16_t)fixture_random_in(random, 200, 1500);
    rig.config.radius_mm = (uint16_t)fixture_random_in(random, 60, 400);
    rig.config.accel_mm_s2 = (uint16_t)fixture_random_in(random, 400, 20000);
    rig.config.decel_mm_s2 = (uint16_t)fixture_random_in(random, 400, 20000);
    rig.config.current_role = (fixture_random_in(random, 0, 1) == 0) ? IW_ROLE_LIMIT : IW_ROLE_SETPOINT;
    setpoint_rig_begin(&rig);
}

static void command_anything(fixture_random_t *random, iw_pair_t *target) {
    int32_t speeds[IW_SIDES] = {fixture_random_in(random, -1000, 1000), fixture_random_in(random, -1000, 1000)};
    (void)iw_yaw_limit(&rig.setpoint.yaw, speeds);
    for (int side = 0; side < IW_SIDES; side++) {
        target->wheel[side].speed_mm_s = (int16_t)speeds[side];
        target->wheel[side].current_mA = (int16_t)fixture_random_in(random, 0, 2000);
    }
    iw_setpoint_command(&rig.setpoint, rig.now_us, target);
}

TEST(test_yaw_stays_bounded_and_every_target_is_reached) {
    fixture_random_t random;
    fixture_random_init(&random, 22);
    for (uint32_t run = 0; run < 300; run++) {
        iw_pair_t target = {{{0, 0}, {0, 0}}};
        draw_config(&random);
        setpoint_rig_follow(&rig);
        const iw_yaw_t *const yaw = &rig.setpoint.yaw;
        iw_pair_t before = iw_setpoint_applied(&rig.setpoint);
        iw_time_us_t before_us = rig.now_us;
        for (uint32_t n = 0; n < 3000; n++) {
            if (n < 300U && n % 20U == 0U) {
                command_anything(&random, &target);
            }
            const iw_pair_t pair = setpoint_rig_take_next(&rig);
            const int32_t growth = (int32_t)((rig.now_us - before_us) * yaw->growth_mm_s2 / 1000000U);
            TEST_ASSERT_TRUE(abs(turn_of(&pair)) <= yaw->most_mm_s);
            TEST_ASSERT_TRUE(abs(turn_of(&pair)) - abs(turn_of(&before)) <= growth + 2);
            before = pair;
            before_us = rig.now_us;
            if (n >= 300U && pair.wheel[0].speed_mm_s == target.wheel[0].speed_mm_s &&
                pair.wheel[1].speed_mm_s == target.wheel[1].speed_mm_s) {
                break;
            }
        }
        TEST_ASSERT_EQUAL_INT16(target.wheel[IW_LEFT].speed_mm_s, before.wheel[IW_LEFT].speed_mm_s);
        TEST_ASSERT_EQUAL_INT16(target.wheel[IW_RIGHT].speed_mm_s, before.wheel[IW_RIGHT].speed_mm_s);
    }
}
