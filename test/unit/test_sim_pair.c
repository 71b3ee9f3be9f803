// SPDX-License-Identifier: MIT
// The pair of simulated wheels: the time of each frame, power, boot and reboot, determinism.
#include "test_sim_rig.h"

#include "unit.h"

#include <string.h>

void setUp(void) {
    rig_init();
}

TEST(test_sim_pair_every_id_has_its_exact_period_for_10_s) {
    static const struct {
        uint32_t id;
        uint32_t period_us;
    } due[] = {{256U, 4000U},  {288U, 4000U},  {257U, 40000U},   {289U, 40000U},  {290U, 40000U},
               {512U, 50000U}, {544U, 50000U}, {513U, 1000000U}, {545U, 1000000U}};
    rig_run(START_US, START_US + 4U * SECOND);
    rig_forget();
    rig_run(START_US + 4U * SECOND, START_US + 14U * SECOND);
    for (size_t i = 0U; i < sizeof due / sizeof due[0]; i++) {
        seen_t const *const of = &seen[due[i].id];
        TEST_ASSERT_EQUAL_UINT32(10000000U / due[i].period_us, of->count);
        TEST_ASSERT_EQUAL_UINT32(due[i].period_us, of->shortest_us);
        TEST_ASSERT_EQUAL_UINT32(due[i].period_us, of->longest_us);
    }
}

TEST(test_sim_pair_sends_its_nine_ids_only) {
    uint32_t total = 0U;
    uint32_t known = 0U;
    rig_run(START_US, START_US + 10U * SECOND);
    for (uint32_t id = 0U; id < sizeof seen / sizeof seen[0]; id++) {
        total += seen[id].count;
    }
    for (size_t i = 0U; i < 9U; i++) {
        static const uint32_t ids[] = {256U, 257U, 288U, 289U, 290U, 512U, 513U, 544U, 545U};
        known += seen[ids[i]].count;
        TEST_ASSERT_GREATER_THAN_UINT32(0U, seen[ids[i]].count);
    }
    TEST_ASSERT_EQUAL_UINT32(known, total);
}

TEST(test_sim_pair_neither_sends_nor_receives_while_it_boots) {
    TEST_ASSERT_FALSE(sim_pair_acknowledges(&pair));
    rig_drive(500, 500);
    rig_run(START_US, START_US + 399U * MS);
    TEST_ASSERT_EQUAL_UINT32(0U, pair.wheel[IW_LEFT].motion.setpoints);
    TEST_ASSERT_EQUAL_UINT32(0U, seen[256].count);
    rig_run(START_US + 399U * MS, START_US + 410U * MS);
    TEST_ASSERT_GREATER_THAN_UINT32(0U, seen[256].count);
    TEST_ASSERT_EQUAL_UINT32(0U, seen[288].count);
    TEST_ASSERT_TRUE(sim_pair_acknowledges(&pair));
}

TEST(test_sim_pair_offset_frames_end_60_s_after_the_start) {
    rig_run(START_US, START_US + 100U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(58U, seen[513].count);
    TEST_ASSERT_EQUAL_UINT32(58U, seen[545].count);
    TEST_ASSERT_LESS_THAN_UINT64(START_US + 400U * MS + 60U * SECOND, seen[513].last_us);
    TEST_ASSERT_GREATER_THAN_UINT64(START_US + 400U * MS + 59U * SECOND, seen[513].last_us);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT64(START_US + 400U * MS + 2U * SECOND, seen[513].first_us);
}

TEST(test_sim_pair_reboot_of_one_wheel_resets_ticks_and_offsets) {
    rig_drive(500, 500);
    rig_run(START_US, START_US + 70U * SECOND);
    TEST_ASSERT_GREATER_THAN_INT32(1000, rig_last(257U).as.status.odometry_ticks);
    rig_forget();
    sim_pair_reboot(&pair, START_US + 70U * SECOND, IW_LEFT);
    rig_run(START_US + 70U * SECOND, START_US + 70U * SECOND + 390U * MS);
    TEST_ASSERT_EQUAL_UINT32(0U, seen[256].count + seen[257].count + seen[512].count + seen[513].count);
    TEST_ASSERT_GREATER_THAN_UINT32(90U, seen[288].count);
    rig_let_go();
    rig_run(START_US + 70U * SECOND + 390U * MS, START_US + 140U * SECOND);
    TEST_ASSERT_INT32_WITHIN(5, 0, rig_last(257U).as.status.odometry_ticks);
    TEST_ASSERT_EQUAL_UINT32(58U, seen[513].count);
    TEST_ASSERT_EQUAL_UINT32(0U, seen[545].count);
    TEST_ASSERT_EQUAL_UINT32(2U, pair.wheel[IW_LEFT].boots);
}

TEST(test_sim_pair_without_power_sends_nothing_and_coasts) {
    rig_drive(700, 700);
    rig_run(START_US, START_US + 3U * SECOND);
    sim_pair_power(&pair, START_US + 3U * SECOND, false);
    rig_forget();
    TEST_ASSERT_FALSE(sim_pair_acknowledges(&pair));
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, sim_pair_next_us(&pair));
    rig_run(START_US + 3U * SECOND, START_US + 6U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(0U, seen[256].count + seen[288].count);
    rig_let_go();
    sim_pair_power(&pair, START_US + 6U * SECOND, true);
    TEST_ASSERT_EQUAL_INT32(0, pair.wheel[IW_LEFT].motion.speed_um_s);
    rig_run(START_US + 6U * SECOND, START_US + 7U * SECOND);
    TEST_ASSERT_EQUAL_INT32(0, rig_last(257U).as.status.odometry_ticks);
    TEST_ASSERT_EQUAL_INT(0, rig_last(256U).as.speed.speed_rpm);
}

TEST(test_sim_pair_power_set_twice_changes_nothing) {
    rig_run(START_US, BOOTED);
    sim_pair_t const before = pair;
    sim_pair_power(&pair, BOOTED, true);
    TEST_ASSERT_EQUAL_MEMORY(&before, &pair, sizeof pair);
    sim_pair_power(&pair, BOOTED, false);
    sim_pair_reboot(&pair, BOOTED + 1U, IW_LEFT);
    TEST_ASSERT_EQUAL_INT(SIM_WHEEL_OFF, pair.wheel[IW_LEFT].state);
}

TEST(test_sim_pair_muted_wheel_follows_and_acknowledges) {
    pair.wheel[IW_LEFT].muted = true;
    rig_drive(500, 500);
    rig_run(START_US, START_US + 3U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(0U, seen[256].count + seen[257].count + seen[512].count + seen[513].count);
    TEST_ASSERT_INT32_WITHIN(1000, 500000, pair.wheel[IW_LEFT].motion.speed_um_s);
    TEST_ASSERT_TRUE(sim_pair_acknowledges(&pair));
    pair.wheel[IW_LEFT].muted = false;
    rig_run(START_US + 3U * SECOND, START_US + 4U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(250U, seen[256].count);
}

TEST(test_sim_pair_older_than_60_s_sends_no_offset) {
    config.age_us = 61U * SECOND;
    sim_pair_init(&pair, &config, START_US, 1U);
    rig_run(START_US, START_US + 5U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(1251U, seen[256].count);
    TEST_ASSERT_EQUAL_UINT32(0U, seen[513].count + seen[545].count);
    TEST_ASSERT_EQUAL_INT(123, pair.wheel[IW_LEFT].force.learned_dN);
}

TEST(test_sim_pair_aged_30_s_sends_offsets_for_30_s) {
    config.age_us = 30U * SECOND;
    sim_pair_init(&pair, &config, START_US, 1U);
    rig_run(START_US, START_US + 100U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(30U, seen[513].count);
}

TEST(test_sim_pair_loss_drops_its_share_of_frames) {
    rig_run(START_US, BOOTED);
    rig_forget();
    pair.wheel[IW_LEFT].loss_permille = 250U;
    rig_drive(100, 100);
    rig_run(BOOTED, BOOTED + 40U * SECOND);
    TEST_ASSERT_UINT32_WITHIN(200U, 7500U, seen[256].count);
    TEST_ASSERT_UINT32_WITHIN(80U, 1500U, pair.wheel[IW_LEFT].motion.setpoints);
    TEST_ASSERT_EQUAL_UINT32(10000U, seen[288].count);
    pair.wheel[IW_LEFT].loss_permille = 1000U;
    rig_forget();
    rig_run(BOOTED + 40U * SECOND, BOOTED + 45U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(0U, seen[256].count);
}

TEST(test_sim_pair_slow_stretches_every_period) {
    sim_wheel_slow(&pair.wheel[IW_LEFT], 2500U);
    rig_run(START_US, START_US + 3U * SECOND);
    rig_forget();
    rig_run(START_US + 3U * SECOND, START_US + 13U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(1000U, seen[256].count);
    TEST_ASSERT_EQUAL_UINT32(10000U, seen[256].shortest_us);
    TEST_ASSERT_EQUAL_UINT32(100000U, seen[257].longest_us);
    TEST_ASSERT_EQUAL_UINT32(2500U, seen[288].count);
    sim_wheel_slow(&pair.wheel[IW_LEFT], 1000U);
    rig_forget();
    rig_run(START_US + 14U * SECOND, START_US + 24U * SECOND);
    TEST_ASSERT_UINT32_WITHIN(260U, 2500U, seen[256].count);
}

TEST(test_sim_pair_ignores_frames_that_are_no_setpoint) {
    rig_run(START_US, BOOTED);
    sim_pair_t const before = pair;
    static const iw_can_frame_t strange[] = {
        {.id = 266U | IW_CAN_REMOTE, .dlc = 5U},
        {.id = 266U | IW_CAN_EXTENDED, .dlc = 5U},
        {.id = 266U | IW_CAN_FD, .dlc = 8U},
        {.id = 266U | IW_CAN_ERROR, .dlc = 8U},
        {.id = 266U, .dlc = 4U},
        {.id = 267U, .dlc = 5U},
        {.id = 288U, .dlc = 4U, .data = {1, 44}},
        {.id = 513U, .dlc = 2U},
    };
    for (size_t i = 0U; i < sizeof strange / sizeof strange[0]; i++) {
        sim_pair_receive(&pair, BOOTED, &strange[i]);
    }
    TEST_ASSERT_EQUAL_MEMORY(&before, &pair, sizeof pair);
}

static void expect_same(const sim_sent_t *one, const sim_sent_t *other) {
    TEST_ASSERT_EQUAL_UINT64(one->due_us, other->due_us);
    TEST_ASSERT_EQUAL_HEX32(one->frame.id, other->frame.id);
    TEST_ASSERT_EQUAL_UINT8(one->frame.dlc, other->frame.dlc);
    TEST_ASSERT_EQUAL_MEMORY(one->frame.data, other->frame.data, sizeof one->frame.data);
}

TEST(test_sim_pair_bytes_do_not_depend_on_the_steps) {
    static sim_pair_t fine;
    iw_time_us_t fine_us = START_US;
    sim_sent_t one;
    sim_sent_t other;
    uint32_t frames = 0U;
    sim_pair_init(&fine, &config, START_US, 1U);
    while (sim_pair_step(&pair, START_US + 20U * SECOND, &one)) {
        while (!sim_pair_step(&fine, fine_us, &other)) {
            fine_us += 137U;
        }
        expect_same(&one, &other);
        frames += 1U;
    }
    TEST_ASSERT_GREATER_THAN_UINT32(12000U, frames);
}

TEST(test_sim_pair_another_seed_gives_other_noise) {
    static sim_pair_t other;
    sim_sent_t sent;
    uint32_t differ = 0U;
    sim_pair_init(&other, &config, START_US, 2U);
    rig_run(START_US + 5U * SECOND, START_US + 5U * SECOND);
    iw_can_frame_t const mine = seen[512].frame;
    while (sim_pair_step(&other, START_US + 5U * SECOND, &sent)) {
        differ += (sent.frame.id == 512U && memcmp(mine.data, sent.frame.data, sizeof mine.data) != 0) ? 1U : 0U;
    }
    TEST_ASSERT_GREATER_THAN_UINT32(50U, differ);
}

TEST(test_sim_pair_null_configuration_is_the_default) {
    static sim_pair_t standard;
    sim_sent_t one;
    sim_sent_t other;
    sim_pair_init(&standard, NULL, START_US, 1U);
    while (sim_pair_step(&pair, START_US + 5U * SECOND, &one)) {
        TEST_ASSERT_TRUE(sim_pair_step(&standard, START_US + 5U * SECOND, &other));
        expect_same(&one, &other);
    }
    TEST_ASSERT_FALSE(sim_pair_step(&standard, START_US + 5U * SECOND, &other));
}
