// SPDX-License-Identifier: MIT
// State that a late step does not change, and arm while the last zero is not yet echoed.
#include "test_gateway_core_rig.h"
#include "unit.h"

#include <stdio.h>

static bool lost_reported(void) {
    return (rig.gateway.permit.present & (1U << IW_CAUSE_WHEEL_LOST)) != 0U;
}

TEST(test_gateway_late_step_does_not_end_the_loss_of_a_wheel) {
    gateway_rig_run(&rig, MS(500));
    rig.wheel[IW_LEFT].mute = true;
    gateway_rig_run(&rig, MS(200));
    TEST_ASSERT_TRUE(lost_reported());
    for (uint32_t i = 0; i < 5U; i++) {
        stall_by(MS(60));
        TEST_ASSERT_TRUE(lost_reported());
        gateway_rig_step(&rig);
        TEST_ASSERT_TRUE(lost_reported());
    }
}

TEST(test_gateway_late_step_does_not_lose_an_online_wheel) {
    gateway_rig_run(&rig, MS(500));
    for (uint32_t i = 0; i < 5U; i++) {
        stall_by(MS(60));
        TEST_ASSERT_FALSE(lost_reported());
        gateway_rig_run(&rig, MS(10));
        TEST_ASSERT_FALSE(lost_reported());
    }
}

static void run_until_a_pair_is_on_its_way(void) {
    for (unsigned i = 0; i < 300U && rig.gateway.sender.confirmation.pending[IW_LEFT] == 0U; i++) {
        gateway_rig_run(&rig, MS(1) / 10U);
    }
    TEST_ASSERT_TRUE(rig.gateway.sender.confirmation.pending[IW_LEFT] > 0U);
}

TEST(test_gateway_arm_after_an_unechoed_zero_is_not_refused) {
    gateway_rig_arm(&rig);
    gateway_rig_stop(&rig);
    run_until_a_pair_is_on_its_way();
    iw_gateway_estop(&rig.gateway, rig.now_us, OTHER);
    gateway_rig_run(&rig, MS(1100));
    run_until_a_pair_is_on_its_way();
    gateway_rig_step(&rig); // The zero is not echoed yet, and the gateway has polled.
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_reset(&rig.gateway, rig.now_us));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_arm(&rig.gateway, rig.now_us, HOLDER, false));
    gateway_rig_run(&rig, MS(30));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

/// Makes steps that are each 30 ms late, while the holder continues to command.
static void crawl_for(iw_time_us_t for_us) {
    const iw_time_us_t until_us = rig.now_us + for_us;
    const iw_drive_t drive = {{300, 300}, {0, 0}, false};
    iw_applied_t applied;
    while (rig.now_us < until_us) {
        stall_by(MS(30));
        (void)iw_gateway_drive(&rig.gateway, rig.now_us, HOLDER, &drive, &applied);
    }
}

TEST(test_gateway_repeated_late_steps_stop_like_one_long_stall) {
    arm_and_cruise(300, 300, MS(500));
    crawl_for(MS(60));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    crawl_for(MS(200));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LOOP_LATE, stop()->cause);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_suspended_in_motion_latches_and_sends_zero) {
    arm_and_cruise(300, 300, MS(500));
    iw_gateway_suspended(&rig.gateway, MS(5000));
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LOOP_HUNG, stop()->cause);
    TEST_ASSERT_EQUAL_UINT32(5000, stop()->detail);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.late_steps);
}

TEST(test_gateway_suspended_for_200_ms_stops) {
    arm_and_cruise(300, 300, MS(500));
    iw_gateway_suspended(&rig.gateway, MS(200));
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LOOP_LATE, stop()->cause);
    TEST_ASSERT_EQUAL_UINT32(200, stop()->detail);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_NONE, stop()->sides);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_suspended_below_100_ms_continues_to_drive) {
    static const struct {
        uint32_t for_us;
        uint32_t late_steps;
    } cases[] = {{20000, 0}, {20001, 1}, {99999, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        gateway_rig_init(&rig);
        arm_and_cruise(300, 300, MS(500));
        TEST_ASSERT_TRUE(rig.now_us < rig.wake_us); // The step is not late by the clock.
        iw_gateway_suspended(&rig.gateway, cases[i].for_us);
        gateway_rig_step(&rig);
        TEST_ASSERT_EQUAL_UINT32(cases[i].late_steps, rig.gateway.counters.late_steps);
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
        gateway_rig_run(&rig, MS(5)); // One step on time ends the time without judgement.
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    }
}

TEST(test_gateway_suspended_again_after_a_late_step_stops) {
    arm_and_cruise(300, 300, MS(500));
    iw_gateway_suspended(&rig.gateway, MS(30));
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    iw_gateway_suspended(&rig.gateway, MS(200));
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LOOP_LATE, stop()->cause);
    TEST_ASSERT_EQUAL_UINT32(200, stop()->detail);
}

TEST(test_gateway_backlog_after_a_punctual_step_has_known_age) {
    gateway_rig_run(&rig, MS(500));
    rig.bus.flood = IW_GATEWAY_DRAIN_MAX + 10U;
    gateway_rig_step(&rig);
    TEST_ASSERT_TRUE(rig.gateway.backlog);
    gateway_rig_step(&rig);
    TEST_ASSERT_FALSE(rig.gateway.stalled);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.late_steps);
}

TEST(test_gateway_backlog_of_a_late_step_counts_one_late_step) {
    gateway_rig_run(&rig, MS(500));
    rig.bus.flood = 2U * IW_GATEWAY_DRAIN_MAX;
    stall_by(MS(60));
    gateway_rig_step(&rig);
    TEST_ASSERT_TRUE(rig.gateway.stalled);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.late_steps);
}

static void expect_no_side(iw_cause_t cause) {
    TEST_ASSERT_EQUAL_INT(cause, stop()->cause);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_NONE, stop()->sides);
}

TEST(test_gateway_causes_without_a_wheel_name_no_wheel) {
    gateway_rig_arm(&rig);
    gateway_rig_press(&rig, true);
    gateway_rig_step(&rig);
    expect_no_side(IW_CAUSE_ESTOP_LINE);
    gateway_rig_init(&rig);
    gateway_rig_arm(&rig);
    fake_bus_break(&rig.bus, IW_BUS_OFF);
    gateway_rig_step(&rig);
    expect_no_side(IW_CAUSE_BUS_DOWN);
    gateway_rig_init(&rig);
    gateway_rig_arm(&rig);
    rig.bus.acknowledged = false;
    gateway_rig_run(&rig, MS(200));
    expect_no_side(IW_CAUSE_SEND_STALLED);
    gateway_rig_init(&rig);
    gateway_rig_arm(&rig);
    stall_by(MS(600));
    expect_no_side(IW_CAUSE_LOOP_HUNG);
}

/// Sends a drive of HOLDER that was sent at this time and arrives now.
static iw_refusal_t drive_sent(iw_time_us_t sent_us) {
    const iw_drive_t drive = {{300, 300}, {0, 0}, false};
    iw_applied_t applied;
    return iw_gateway_drive(&rig.gateway, sent_us, HOLDER, &drive, &applied);
}

TEST(test_gateway_drive_older_than_arm_is_stale) {
    gateway_rig_arm(&rig);
    const iw_time_us_t armed_us = rig.gateway.permit.armed_us;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_STALE_COMMAND, drive_sent(armed_us - 1U));
    TEST_ASSERT_TRUE(iw_setpoint_next_is_zero(&rig.gateway.setpoint));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, drive_sent(armed_us));
}

TEST(test_gateway_drive_that_waited_renews_from_its_send_time) {
    arm_and_cruise(300, 300, MS(500));
    const iw_time_us_t sent_us = rig.now_us - MS(150);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, drive_sent(sent_us));
    gateway_rig_run(&rig, MS(49));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    gateway_rig_run(&rig, MS(2));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LEASE_LOST, stop()->cause);
}

/// The lease of arm of HOLDER still lasts, and a zero pair is sent at this time. The nonzero command of HOLDER arrives
/// now, but it is too old to prevent arm.
static void drive_that_waited_too_long(void) {
    gateway_rig_arm(&rig);
    const iw_time_us_t sent_us = rig.now_us;
    gateway_rig_run(&rig, MS(600));
    for (unsigned i = 0; i < 300U && rig.gateway.setpoint.last_us != rig.now_us; i++) {
        gateway_rig_run(&rig, MS(1) / 10U);
    }
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.gateway.setpoint.last_us);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, drive_sent(sent_us));
}

static void assert_armed_and_still(void) {
    for (unsigned i = 0; i < 50U; i++) {
        gateway_rig_run(&rig, MS(10));
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
        TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    }
}

TEST(test_gateway_takeover_does_not_inherit_a_command) {
    drive_that_waited_too_long();
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_arm(&rig.gateway, rig.now_us, OTHER, true));
    assert_armed_and_still();
}

TEST(test_gateway_stop_and_arm_at_one_time_drop_the_command) {
    drive_that_waited_too_long();
    iw_gateway_stop(&rig.gateway, rig.now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_arm(&rig.gateway, rig.now_us, HOLDER, false));
    gateway_rig_stall(&rig, MS(2)); // Both echoes arrive in one step.
    assert_armed_and_still();
}

TEST(test_gateway_drive_that_waited_does_not_set_stale_time_back) {
    arm_and_cruise(300, 300, MS(500));
    const iw_time_us_t last_us = rig.gateway.permit.stale_us;
    (void)drive_sent(last_us - MS(100));
    TEST_ASSERT_EQUAL_UINT64(last_us, rig.gateway.permit.stale_us);
}

// Wheels that do not follow while steps are often late ------------------------------------------------------------------

typedef struct {
    const char *name;
    iw_cause_t cause;
    int32_t commanded_mm_s;
    int16_t rpm[IW_SIDES]; ///< OBEYS: as commanded.
} fault_t;

enum { OBEYS = INT16_MAX };

static const fault_t faults[] = {
    {"left wheel blocked", IW_CAUSE_PAIR_DIVERGES, 400, {0, OBEYS}},
    {"left wheel at 75 %", IW_CAUSE_PAIR_DIVERGES, 800, {30, OBEYS}},
    {"right wheel backwards", IW_CAUSE_PAIR_DIVERGES, 400, {OBEYS, -20}},
    {"both too fast", IW_CAUSE_OVERSPEED, 400, {45, 45}},
    {"both backwards", IW_CAUSE_FEEDBACK_SIGN, 400, {-20, -20}},
    {"both blocked", IW_CAUSE_WHEEL_BLOCKED, 400, {0, 0}},
};

/// Drives, with one step of `late_ms` in each `every_ms`, until something stops the wheels, at most for `for_ms`.
static void cruise_often_late(int32_t left_mm_s, int32_t right_mm_s, uint32_t late_ms, uint32_t every_ms,
                              uint32_t for_ms) {
    const iw_time_us_t until_us = rig.now_us + MS(for_ms);
    while (rig.now_us < until_us && state() == IW_STATE_ARMED) {
        (void)gateway_rig_cruise(&rig, left_mm_s, right_mm_s, MS(every_ms - late_ms));
        stall_by(MS(late_ms));
    }
}

TEST(test_gateway_often_late_detects_each_wheel_that_does_not_follow) {
    static const struct {
        uint32_t late_ms, every_ms;
    } rates[] = {{25, 50}, {25, 100}, {25, 300}, {60, 100}, {60, 300}, {99, 130}, {99, 300}};
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        for (size_t k = 0; k < sizeof rates / sizeof *rates; k++) {
            char words[80];
            const int32_t mm_s = faults[i].commanded_mm_s;
            (void)snprintf(words, sizeof words, "%s, %u ms late in each %u ms", faults[i].name,
                           (unsigned)rates[k].late_ms, (unsigned)rates[k].every_ms);
            setUp();
            arm_and_cruise(mm_s, mm_s, MS(1500));
            for (size_t side = 0; side < IW_SIDES; side++) {
                rig.wheel[side].rpm_fixed = faults[i].rpm[side] != OBEYS;
                rig.wheel[side].rpm = faults[i].rpm[side];
            }
            const iw_time_us_t since_us = rig.now_us;
            cruise_often_late(mm_s, mm_s, rates[k].late_ms, rates[k].every_ms, 4000);
            TEST_ASSERT_EQUAL_INT_MESSAGE(faults[i].cause, stop()->cause, words);
            TEST_ASSERT_LESS_THAN_UINT64_MESSAGE(MS(1500), rig.now_us - since_us, words);
            tearDown();
        }
    }
}

TEST(test_gateway_often_late_does_not_stop_wheels_that_follow) {
    static const int32_t pairs[][IW_SIDES] = {{800, 800}, {-600, -600}, {300, -300}, {0, 500}, {-200, 200}, {40, 40}};
    static const uint32_t late_ms[] = {25, 60, 99};
    for (size_t k = 0; k < sizeof late_ms / sizeof *late_ms; k++) {
        setUp();
        gateway_rig_arm(&rig);
        for (size_t i = 0; i < 3U * sizeof pairs / sizeof *pairs; i++) {
            const int32_t *const pair = pairs[i % (sizeof pairs / sizeof *pairs)];
            cruise_often_late(pair[IW_LEFT], pair[IW_RIGHT], late_ms[k], late_ms[k] + 30U, 1000);
            TEST_ASSERT_EQUAL_INT_MESSAGE(IW_STATE_ARMED, state(), "it stopped");
        }
        tearDown();
    }
}
