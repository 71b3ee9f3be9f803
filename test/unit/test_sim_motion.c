// SPDX-License-Identifier: MIT
// The motion of the simulated wheel and its parts: random numbers, sine, watchdog, torque, ticks.
#include "iwheel_sim/motion.h"
#include "iwheel_sim/trig.h"

#include "unit.h"

#include <string.h>

#define START_US 5000000U
#define MS       1000U

static sim_motion_config_t config;
static sim_motion_t motion;

void setUp(void) {
    sim_motion_default(&config);
    memset(&motion, 0xA5, sizeof motion);
    sim_motion_init(&motion, &config, START_US);
}

static void restart(void) {
    sim_motion_init(&motion, &config, START_US);
}

static bool command(iw_time_us_t now_us, int16_t speed_mm_s, int16_t current_mA) {
    iw_codec_setpoint_t const setpoint = {speed_mm_s, current_mA, 1U};
    return sim_motion_receive(&motion, now_us, &setpoint);
}

/// Sends the same setpoint every 20 ms for `ms`; returns the end time.
static iw_time_us_t drive(iw_time_us_t from_us, uint32_t ms, int16_t speed_mm_s, int16_t current_mA) {
    iw_time_us_t now_us = from_us;
    for (; now_us < from_us + (iw_time_us_t)ms * MS; now_us += 20U * MS) {
        TEST_ASSERT_TRUE(command(now_us, speed_mm_s, current_mA));
    }
    sim_motion_advance(&motion, now_us);
    return now_us;
}

TEST(test_random_numbers_depend_on_the_seed_only) {
    sim_random_t one;
    sim_random_t same;
    sim_random_t other;
    unsigned differ = 0U;
    sim_random_init(&one, 7U);
    sim_random_init(&same, 7U);
    sim_random_init(&other, 8U);
    for (unsigned i = 0U; i < 1000U; i++) {
        uint32_t const number = sim_random_next(&one);
        TEST_ASSERT_EQUAL_UINT32(number, sim_random_next(&same));
        differ += (number != sim_random_next(&other)) ? 1U : 0U;
    }
    TEST_ASSERT_GREATER_THAN_UINT32(990U, differ);
}

TEST(test_random_noise_reaches_its_amplitude_around_zero) {
    sim_random_t random;
    int64_t sum = 0;
    int32_t low = 0;
    int32_t high = 0;
    sim_random_init(&random, 1U);
    for (unsigned i = 0U; i < 20000U; i++) {
        int32_t const value = sim_random_noise(&random, 10);
        sum += value;
        low = (value < low) ? value : low;
        high = (value > high) ? value : high;
    }
    TEST_ASSERT_EQUAL_INT32(-10, low);
    TEST_ASSERT_EQUAL_INT32(10, high);
    TEST_ASSERT_INT64_WITHIN(2000, 0, sum);
    TEST_ASSERT_EQUAL_INT32(0, sim_random_noise(&random, 0));
    TEST_ASSERT_EQUAL_UINT32(0U, sim_random_below(&random, 0U));
}

TEST(test_trig_tabulated_angles_have_tabulated_values) {
    static const struct {
        int64_t angle_nrad;
        int64_t sine_ppm;
        int64_t cosine_ppm;
    } known[] = {
        {0, 0, 1000000},
        {523598776, 500000, 866025},
        {1570796327, 1000000, 0},
        {2356194490, 707107, -707107},
        {3141592654, 0, -1000000},
        {4712388980, -1000000, 0},
        {-523598776, -500000, 866025},
        {10 * SIM_TRIG_TURN_nrad + 523598776, 500000, 866025},
        {-10 * SIM_TRIG_TURN_nrad - 523598776, -500000, 866025},
    };
    for (size_t i = 0U; i < sizeof known / sizeof known[0]; i++) {
        int64_t const sine = sim_trig_sin(known[i].angle_nrad) * 1000000 / SIM_TRIG_ONE;
        int64_t const cosine = sim_trig_cos(known[i].angle_nrad) * 1000000 / SIM_TRIG_ONE;
        TEST_ASSERT_INT64_WITHIN(10, known[i].sine_ppm, sine);
        TEST_ASSERT_INT64_WITHIN(10, known[i].cosine_ppm, cosine);
    }
}

TEST(test_motion_without_a_setpoint_stays_at_standstill) {
    sim_motion_advance(&motion, START_US + 3600U * 1000000ULL);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
    TEST_ASSERT_EQUAL_INT64(0, motion.position_nm);
    TEST_ASSERT_FALSE(motion.driven);
}

TEST(test_motion_reaches_the_commanded_speed_without_overshoot) {
    iw_time_us_t now_us = START_US;
    for (; now_us < START_US + 1500U * MS; now_us += 20U * MS) {
        (void)command(now_us, 500, 2000);
        TEST_ASSERT_LESS_OR_EQUAL_INT32(500000, motion.speed_um_s);
    }
    TEST_ASSERT_INT32_WITHIN(500, 500000, motion.speed_um_s);
    TEST_ASSERT_EQUAL_INT32(499, sim_motion_true_mm_s(&motion));
}

TEST(test_motion_acceleration_is_bound_by_the_current) {
    static const int16_t current_mA[] = {2000, 1000, -1000, 250};
    static const int32_t most_um_s[] = {400000, 200000, 200000, 50000};
    for (size_t i = 0U; i < 4U; i++) {
        restart();
        (void)drive(START_US, 100U, 5000, current_mA[i]);
        TEST_ASSERT_INT32_WITHIN(2000, most_um_s[i], motion.speed_um_s);
    }
}

TEST(test_motion_current_beyond_the_range_is_limited) {
    (void)drive(START_US, 100U, 5000, 32767);
    TEST_ASSERT_INT32_WITHIN(2000, 400000, motion.speed_um_s);
}

TEST(test_motion_with_a_current_limit_of_zero_coasts) {
    iw_time_us_t const now_us = drive(START_US, 1500U, 1000, 2000);
    (void)drive(now_us, 200U, 1000, 0);
    TEST_ASSERT_INT32_WITHIN(2000, 1000000 - 140000, motion.speed_um_s);
}

TEST(test_motion_setpoint_is_valid_for_one_second) {
    iw_time_us_t const last_us = drive(START_US, 1500U, 1000, 2000);
    TEST_ASSERT_TRUE(command(last_us, 1000, 2000));
    sim_motion_advance(&motion, last_us + 999999U);
    TEST_ASSERT_TRUE(motion.driven);
    TEST_ASSERT_INT32_WITHIN(500, 1000000, motion.speed_um_s);
    sim_motion_advance(&motion, last_us + 1000000U);
    TEST_ASSERT_FALSE(motion.driven);
    TEST_ASSERT_INT32_WITHIN(500, 1000000, motion.speed_um_s);
}

TEST(test_motion_after_the_watchdog_coasts_to_standstill) {
    iw_time_us_t const last_us = drive(START_US, 1500U, 700, 2000);
    sim_motion_advance(&motion, last_us + 980U * MS + 500U * MS);
    TEST_ASSERT_INT32_WITHIN(2000, 350000, motion.speed_um_s);
    sim_motion_advance(&motion, last_us + 980U * MS + 1001U * MS);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
}

TEST(test_motion_fresh_setpoint_after_the_watchdog_drives_again) {
    iw_time_us_t const last_us = drive(START_US, 500U, 300, 2000);
    (void)drive(last_us + 3000U * MS, 500U, -300, 2000);
    TEST_ASSERT_INT32_WITHIN(1000, -300000, motion.speed_um_s);
}

TEST(test_motion_coasting_does_not_depend_on_the_steps) {
    sim_motion_t many;
    iw_time_us_t const last_us = drive(START_US, 500U, 800, 2000);
    many = motion;
    sim_motion_advance(&motion, last_us + 3000U * MS);
    for (unsigned ms = 1U; ms <= 3000U; ms++) {
        sim_motion_advance(&many, last_us + ms * MS);
    }
    TEST_ASSERT_EQUAL_INT32(motion.speed_um_s, many.speed_um_s);
    TEST_ASSERT_INT64_WITHIN(2000000, motion.position_nm, many.position_nm);
}

TEST(test_motion_time_going_back_changes_nothing) {
    (void)drive(START_US, 200U, 800, 2000);
    sim_motion_t const before = motion;
    sim_motion_advance(&motion, START_US);
    TEST_ASSERT_EQUAL_MEMORY(&before, &motion, sizeof motion);
}

TEST(test_motion_type_set_ignores_other_types) {
    config.accepted_type = 7;
    restart();
    iw_codec_setpoint_t setpoint = {500, 2000, 6U};
    TEST_ASSERT_FALSE(sim_motion_receive(&motion, START_US, &setpoint));
    TEST_ASSERT_FALSE(motion.driven);
    TEST_ASSERT_EQUAL_UINT32(0U, motion.setpoints);
    setpoint.type = 7U;
    TEST_ASSERT_TRUE(sim_motion_receive(&motion, START_US, &setpoint));
    TEST_ASSERT_TRUE(motion.driven);
}

TEST(test_motion_current_as_setpoint_speed_zero_is_torque) {
    config.current_is_setpoint = true;
    restart();
    (void)drive(START_US, 200U, 0, 1000);
    TEST_ASSERT_INT32_WITHIN(2000, 400000, motion.speed_um_s);
    (void)drive(START_US + 200U * MS, 400U, 0, -1000);
    TEST_ASSERT_INT32_WITHIN(3000, -400000, motion.speed_um_s);
}

TEST(test_motion_current_as_limit_speed_zero_holds_still) {
    (void)drive(START_US, 200U, 0, 2000);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
}

TEST(test_motion_current_as_setpoint_zero_pair_stops_the_wheel) {
    config.current_is_setpoint = true;
    restart();
    iw_time_us_t const now_us = drive(START_US, 1000U, 300, 1000);
    TEST_ASSERT_INT32_WITHIN(1000, 300000, motion.speed_um_s);
    (void)drive(now_us, 600U, 0, 0);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
}

TEST(test_motion_zero_setpoint_brakes_to_an_exact_stop) {
    iw_time_us_t const now_us = drive(START_US, 1000U, 1000, 2000);
    (void)drive(now_us, 1000U, 0, 2000);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
    TEST_ASSERT_EQUAL_INT64(0, sim_motion_milli_rpm(&motion));
}

TEST(test_motion_blocked_draws_current_without_moving) {
    motion.blocked = true;
    iw_time_us_t const now_us = drive(START_US, 500U, 500, 1500);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
    TEST_ASSERT_EQUAL_INT64(0, motion.position_nm);
    TEST_ASSERT_EQUAL_UINT32(1500U, sim_motion_draw_mA(&motion));
    motion.blocked = false;
    (void)drive(now_us, 500U, 500, 1500);
    TEST_ASSERT_INT32_WITHIN(1000, 500000, motion.speed_um_s);
}

TEST(test_motion_runaway_adds_speed_while_driven) {
    motion.runaway_mm_s = 1000;
    iw_time_us_t now_us = drive(START_US, 1500U, -300, 2000);
    TEST_ASSERT_INT32_WITHIN(2000, -1300000, motion.speed_um_s);
    now_us = drive(now_us, 2000U, 0, 2000);
    TEST_ASSERT_INT32_WITHIN(2000, 1000000, motion.speed_um_s);
    sim_motion_advance(&motion, now_us + 4000U * MS);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
}

TEST(test_motion_one_metre_per_second_is_49_74_rpm) {
    motion.speed_um_s = 1000000;
    TEST_ASSERT_INT64_WITHIN(2, 49736, sim_motion_milli_rpm(&motion));
    TEST_ASSERT_INT32_WITHIN(50, 1000000, sim_motion_um_s_of_milli_rpm(&motion.config, 49736));
}

TEST(test_motion_rpm_of_the_rotor_includes_the_gear) {
    config.gear_turns = 15U;
    config.gear_per = 2U;
    config.rpm_of_rotor = true;
    restart();
    motion.speed_um_s = -1000000;
    TEST_ASSERT_INT64_WITHIN(20, -373020, sim_motion_milli_rpm(&motion));
    TEST_ASSERT_INT32_WITHIN(100, -1000000, sim_motion_um_s_of_milli_rpm(&motion.config, -373020));
}

TEST(test_motion_has_60_ticks_per_turn_in_both_directions) {
    iw_time_us_t now_us = drive(START_US, 4000U, 1000, 2000);
    int64_t const expected = motion.position_nm * 60 / 1206371579;
    TEST_ASSERT_GREATER_THAN_INT64(150, expected);
    TEST_ASSERT_EQUAL_INT64(expected, (int32_t)motion.ticks);
    now_us = drive(now_us, 8000U, -1000, 2000);
    TEST_ASSERT_LESS_THAN_INT64(0, motion.position_nm);
    TEST_ASSERT_EQUAL_INT64(motion.position_nm * 60 / 1206371579 - 1, (int32_t)motion.ticks);
}

TEST(test_motion_ticks_count_rotor_turns) {
    config.gear_turns = 20U;
    restart();
    (void)drive(START_US, 3000U, 500, 2000);
    TEST_ASSERT_EQUAL_INT64(motion.position_nm * 1200 / 1206371579, (int32_t)motion.ticks);
}

TEST(test_motion_swapped_sign_reports_the_opposite_direction) {
    motion.swapped = true;
    (void)drive(START_US, 2000U, 500, 2000);
    TEST_ASSERT_GREATER_THAN_INT64(0, motion.position_nm);
    TEST_ASSERT_LESS_THAN_INT64(0, sim_motion_milli_rpm(&motion));
    TEST_ASSERT_LESS_THAN_INT32(-30, (int32_t)motion.ticks);
}

TEST(test_motion_larger_wheel_has_a_higher_true_speed) {
    config.radius_mm = 384U;
    restart();
    (void)drive(START_US, 2000U, 500, 2000);
    TEST_ASSERT_INT32_WITHIN(1, 999, sim_motion_true_mm_s(&motion));
    TEST_ASSERT_INT64_WITHIN(1, motion.position_nm / 500000, sim_motion_true_mm(&motion));
}

TEST(test_motion_release_clears_the_setpoint) {
    iw_time_us_t const now_us = drive(START_US, 1000U, 500, 2000);
    sim_motion_release(&motion, now_us);
    TEST_ASSERT_FALSE(motion.driven);
    TEST_ASSERT_EQUAL_UINT32(0U, sim_motion_draw_mA(&motion));
    sim_motion_advance(&motion, now_us + 800U * MS);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
}

TEST(test_motion_draws_more_while_it_accelerates) {
    (void)drive(START_US, 60U, 2000, 2000);
    TEST_ASSERT_UINT32_WITHIN(160U, 2000U, sim_motion_draw_mA(&motion));
    (void)drive(START_US + 60U * MS, 2000U, 500, 2000);
    TEST_ASSERT_EQUAL_UINT32(150U, sim_motion_draw_mA(&motion));
}

TEST(test_motion_push_moves_the_wheel_by_the_exact_distance) {
    config.radius_mm = 160U;
    restart();
    sim_motion_push(&motion, START_US, 3000);
    sim_motion_advance(&motion, START_US + 1000U * MS);
    TEST_ASSERT_EQUAL_INT32(1500000, motion.speed_um_s);
    sim_motion_advance(&motion, START_US + 10000U * MS);
    TEST_ASSERT_EQUAL_INT32(0, motion.speed_um_s);
    TEST_ASSERT_EQUAL_INT64(3000, sim_motion_true_mm(&motion));
    TEST_ASSERT_EQUAL_UINT32(179U, motion.ticks); // 3 m are 2.984 turns of a wheel of 160 mm.
    sim_motion_push(&motion, START_US + 10000U * MS, -3000);
    sim_motion_advance(&motion, START_US + 20000U * MS);
    TEST_ASSERT_EQUAL_INT64(0, sim_motion_true_mm(&motion));
}

TEST(test_motion_push_overrides_the_motor_and_ends) {
    TEST_ASSERT_TRUE(command(START_US, 500, 2000));
    sim_motion_push(&motion, START_US, -100);
    sim_motion_advance(&motion, START_US + 40U * MS);
    TEST_ASSERT_EQUAL_INT32(-1500000, motion.speed_um_s);
    (void)drive(START_US + 200U * MS, 1000U, 500, 2000);
    TEST_ASSERT_INT32_WITHIN(5000, 500000, motion.speed_um_s);
}

/// 2^31 nm are 2.1 m.
TEST(test_motion_distance_of_many_metres_does_not_wrap) {
    (void)drive(START_US, 20000U, 1000, 4000);
    TEST_ASSERT_GREATER_THAN_INT64(17000, sim_motion_true_mm(&motion));
    sim_motion_push(&motion, START_US + 30000U * MS, 5000);
    sim_motion_advance(&motion, START_US + 60000U * MS);
    TEST_ASSERT_GREATER_THAN_INT64(22000, sim_motion_true_mm(&motion));
}
