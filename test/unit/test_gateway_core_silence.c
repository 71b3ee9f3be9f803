// SPDX-License-Identifier: MIT
// Silence is silent: what is still in a controller when the zeros end is taken back, or told.
#include "gateway_rig.h"
#include "unit.h"

static gateway_rig_t rig;

void setUp(void) {
    gateway_rig_init(&rig);
}

void tearDown(void) {
    TEST_ASSERT_NULL_MESSAGE(rig.judge.violation, rig.judge.violation);
}

static iw_state_t state(void) {
    return iw_gateway_state(&rig.gateway);
}

/// Of both wheels: without it they neither acknowledge nor send.
static void set_power(bool on) {
    rig.bus.acknowledged = on;
    rig.wheel[IW_LEFT].mute = !on;
    rig.wheel[IW_RIGHT].mute = !on;
}

static void drive_on(void) {
    gateway_rig_arm(&rig);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(1000));
    TEST_ASSERT_EQUAL_INT(400, rig.bus.commanded_mm_s[IW_LEFT]);
    gateway_rig_run(&rig, MS(1));
}

/// To the step that ends the zeros of a stop.
static void run_to_silence(void) {
    for (unsigned n = 0; n < 70000U && (rig.gateway.permit.phase == IW_PHASE_CUT || state() == IW_STATE_STOPPING);
         n++) {
        gateway_rig_run(&rig, 1000);
    }
    TEST_ASSERT_FALSE(rig.gateway.permit.phase == IW_PHASE_CUT || state() == IW_STATE_STOPPING);
}

/// Power is cut in motion; ends when the zeros do.
static void cut_power_in_motion(int purge_result) {
    drive_on();
    rig.bus.purge_result = purge_result;
    set_power(false);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    run_to_silence();
}

/// Nobody acknowledges, so the zeros of an arm stay behind; ends when the arm is given up.
static void arm_in_vain(int purge_result) {
    gateway_rig_run(&rig, MS(1100));
    rig.bus.purge_result = purge_result;
    rig.bus.acknowledged = false;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    for (unsigned n = 0; n < 100U && iw_gateway_arming(&rig.gateway); n++) {
        TEST_ASSERT_EQUAL_UINT32(0, rig.bus.purges);
        gateway_rig_run(&rig, 1000);
    }
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, iw_gateway_arm_refusal(&rig.gateway));
}

/// Power comes back, and nothing of what was sent before comes with it.
static void expect_silence_with_power(void) {
    const iw_time_us_t told_us[IW_SIDES] = {rig.bus.told_us[IW_LEFT], rig.bus.told_us[IW_RIGHT]};
    const uint32_t sent = rig.bus.sent;
    set_power(true);
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_UINT64(told_us[IW_LEFT], rig.bus.told_us[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT64(told_us[IW_RIGHT], rig.bus.told_us[IW_RIGHT]);
    TEST_ASSERT_EQUAL_UINT32(sent, rig.bus.sent);
}

TEST(test_gateway_missing_echo_latches_with_one_zero_behind_and_a_purge) {
    drive_on();
    const uint32_t sent = rig.bus.sent;
    rig.bus.acknowledged = false;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(50));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_EQUAL_UINT32(sent + 2U, rig.bus.sent);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(50));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_SEND_STALLED, rig.gateway.permit.stop.cause);
    TEST_ASSERT_UINT32_WITHIN(20, 60, rig.gateway.permit.stop.detail);
    for (unsigned n = 0; n < 1100U && rig.gateway.permit.phase == IW_PHASE_CUT; n++) {
        TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
        TEST_ASSERT_FALSE(rig.gateway.left_behind);
        gateway_rig_run(&rig, MS(10));
    }
    TEST_ASSERT_FALSE(rig.gateway.permit.phase == IW_PHASE_CUT);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(sent + 4U, rig.bus.sent);
    TEST_ASSERT_TRUE(gateway_rig_told_zero(&rig));
}

TEST(test_gateway_purged_frames_never_come_out) {
    drive_on();
    rig.bus.acknowledged = false;
    rig.bus.purge_result = 1;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.purges);
    for (uint32_t i = 0; i < rig.bus.flights; i++) {
        TEST_ASSERT_EQUAL_INT(0, fake_bus_command(&rig.bus.flight[i].frame).speed_mm_s);
    }
    rig.bus.commanded_mm_s[IW_LEFT] = 0;
    rig.bus.commanded_mm_s[IW_RIGHT] = 0;
    rig.bus.acknowledged = true;
    gateway_rig_run(&rig, MS(2000));
    TEST_ASSERT_EQUAL_INT(0, rig.bus.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(0, rig.bus.commanded_mm_s[IW_RIGHT]);
}

TEST(test_gateway_zeros_without_power_are_taken_back_when_they_end) {
    cut_power_in_motion(1);
    TEST_ASSERT_EQUAL_UINT32(2, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.flights);
    gateway_rig_run(&rig, MS(20000));
    TEST_ASSERT_EQUAL_UINT32(2, rig.bus.purges);
    TEST_ASSERT_FALSE(rig.gateway.left_behind);
    expect_silence_with_power();
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_reset(&rig));
    gateway_rig_arm(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_zeros_of_an_arm_in_vain_are_taken_back_at_once) {
    arm_in_vain(1);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.flights);
    expect_silence_with_power();
    gateway_rig_arm(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_zeros_for_a_dead_process_are_taken_back_when_they_end) {
    gateway_rig_begin(&rig, true);
    rig.bus.purge_result = 1;
    set_power(false);
    run_to_silence();
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(2, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.flights);
    expect_silence_with_power();
}

TEST(test_gateway_zeros_for_a_dead_process_are_asked_back_once_while_they_last) {
    gateway_rig_begin(&rig, true);
    set_power(false);
    gateway_rig_run(&rig, MS(1400));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_reset_in_the_zeros_takes_back_what_is_not_echoed) {
    drive_on();
    iw_gateway_estop(&rig.gateway, rig.now_us, OTHER);
    gateway_rig_run(&rig, MS(1100));
    rig.bus.purge_result = 1;
    rig.bus.acknowledged = false;
    gateway_rig_run(&rig, MS(30));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_reset(&rig));
    TEST_ASSERT_TRUE(rig.bus.flights > 0U);
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.flights);
    expect_silence_with_power();
}

TEST(test_gateway_ordinary_stop_asks_nothing_back) {
    for (unsigned n = 0; n < 20U; n++) {
        setUp();
        rig.bus.echo_delay_us = MS(n);
        gateway_rig_arm(&rig);
        gateway_rig_run(&rig, MS(100) + 1000U * n);
        gateway_rig_stop(&rig);
        run_to_silence();
        gateway_rig_run(&rig, MS(5000));
        TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
        TEST_ASSERT_EQUAL_UINT32(0, rig.bus.purges);
        TEST_ASSERT_FALSE(rig.gateway.left_behind);
        tearDown();
    }
}

/// The zeros of an arm that is given up as soon as they were handed over.
static iw_time_us_t leave_young_zeros(void) {
    gateway_rig_run(&rig, MS(1100));
    rig.bus.acknowledged = false;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    const iw_time_us_t sent_us = rig.now_us;
    iw_gateway_disconnect(&rig.gateway, rig.now_us, HOLDER);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(2, rig.bus.flights);
    return sent_us + MS(rig.config.echo_ms);
}

TEST(test_gateway_young_setpoint_is_given_the_time_of_an_echo_to_the_microsecond) {
    const iw_time_us_t overdue_us = leave_young_zeros();
    gateway_rig_run(&rig, overdue_us - 1U - rig.now_us);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.purges);
    gateway_rig_run(&rig, 1);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_echo_that_may_stand_in_a_backlog_is_not_asked_back) {
    const iw_time_us_t overdue_us = leave_young_zeros();
    gateway_rig_run(&rig, overdue_us - 1U - rig.now_us);
    rig.now_us = overdue_us;
    rig.bus.flood = IW_GATEWAY_DRAIN_MAX;
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.purges);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_setpoint_is_asked_back_in_a_late_step_too) {
    const iw_time_us_t overdue_us = leave_young_zeros();
    gateway_rig_stall(&rig, overdue_us + MS(50) - rig.now_us);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_what_the_port_has_not_done_is_asked_back_every_second_wheels_heard_or_not) {
    for (unsigned n = 0; n < 4U; n++) {
        setUp();
        arm_in_vain(0);
        rig.wheel[IW_LEFT].mute = (n & 1U) != 0U;
        rig.wheel[IW_RIGHT].mute = (n & 2U) != 0U;
        TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
        const iw_time_us_t first_us = rig.gateway.purged_us;
        gateway_rig_run(&rig, first_us + IW_GATEWAY_LOST_ECHO_US - 1U - rig.now_us);
        gateway_rig_step(&rig);
        TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
        gateway_rig_run(&rig, 1);
        gateway_rig_step(&rig);
        TEST_ASSERT_EQUAL_UINT32(2, rig.bus.purges);
        gateway_rig_run(&rig, MS(3500));
        TEST_ASSERT_EQUAL_UINT32(5, rig.bus.purges);
        rig.bus.purge_result = 1;
        gateway_rig_run(&rig, MS(3500));
        TEST_ASSERT_EQUAL_UINT32(6, rig.bus.purges);
        tearDown();
    }
}

TEST(test_gateway_setpoint_that_cannot_be_taken_back_is_told_at_once) {
    arm_in_vain(-1);
    TEST_ASSERT_TRUE(rig.gateway.left_behind);
    gateway_rig_run(&rig, MS(10000));
    TEST_ASSERT_TRUE(rig.gateway.left_behind);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.left_behind);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.purges);
}

TEST(test_gateway_setpoint_that_is_not_yet_taken_back_is_told_when_it_is_asked_for_again) {
    arm_in_vain(0);
    const iw_time_us_t again_us = rig.gateway.purged_us + IW_GATEWAY_LOST_ECHO_US;
    gateway_rig_run(&rig, again_us - 1U - rig.now_us);
    gateway_rig_step(&rig);
    TEST_ASSERT_FALSE(rig.gateway.left_behind);
    gateway_rig_run(&rig, 1);
    gateway_rig_step(&rig);
    TEST_ASSERT_TRUE(rig.gateway.left_behind);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.left_behind);
}

TEST(test_gateway_setpoint_that_is_taken_back_when_asked_again_was_not_left) {
    arm_in_vain(0);
    rig.bus.purge_result = 1;
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.left_behind);
}

TEST(test_gateway_silence_after_a_stop_is_asked_once_too) {
    gateway_rig_arm(&rig);
    gateway_rig_stop(&rig);
    run_to_silence();
    TEST_ASSERT_NOT_EQUAL_UINT32(rig.gateway.purged_stop, rig.gateway.permit.stop.number);
    arm_in_vain(0);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_setpoint_is_asked_back_within_the_first_second_of_time) {
    const iw_hal_t hal = fake_bus_hal(&rig.bus);
    rig.now_us = rig.wake_us = rig.wheel[IW_LEFT].speed_us = rig.wheel[IW_RIGHT].speed_us = 1;
    rig.wheel[IW_LEFT].status_us = rig.wheel[IW_RIGHT].status_us = 1;
    fake_bus_init(&rig.bus, rig.now_us);
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_gateway_init(&rig.gateway, &rig.config, &hal, rig.now_us, false));
    gateway_judge_init(&rig.judge, &rig.gateway, &rig.bus);
    gateway_rig_run(&rig, MS(300));
    rig.bus.acknowledged = false;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_TRUE(rig.now_us < IW_GATEWAY_LOST_ECHO_US);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_setpoint_left_behind_is_settled_by_echo_loss_of_the_bus_or_the_port) {
    for (unsigned n = 0; n < 3U; n++) {
        setUp();
        arm_in_vain(-1);
        TEST_ASSERT_TRUE(rig.gateway.left_behind);
        if (n == 0U) {
            rig.bus.acknowledged = true;
        } else if (n == 1U) {
            fake_bus_break(&rig.bus, IW_BUS_ACTIVE); // Down and up again.
        } else {
            rig.bus.purge_result = 1;
        }
        gateway_rig_run(&rig, MS(1100));
        TEST_ASSERT_FALSE(rig.gateway.left_behind);
        const uint32_t purges = rig.bus.purges;
        gateway_rig_run(&rig, MS(5000));
        TEST_ASSERT_EQUAL_UINT32(purges, rig.bus.purges);
        rig.bus.acknowledged = true;
        gateway_rig_arm(&rig);
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
        rig.bus.acknowledged = false;
        rig.bus.purge_result = -1;
        gateway_rig_run(&rig, MS(100));
        TEST_ASSERT_FALSE(rig.gateway.left_behind); // Zeros still follow it.
        run_to_silence();
        TEST_ASSERT_TRUE(rig.gateway.left_behind);
        TEST_ASSERT_EQUAL_UINT32(2, rig.gateway.counters.left_behind);
        tearDown();
    }
}

/// Each silence begins anew: what was asked in the last one, or in the zeros, is no answer for this one.
TEST(test_gateway_next_silence_is_given_its_own_second) {
    arm_in_vain(0);
    rig.bus.acknowledged = true;
    gateway_rig_run(&rig, MS(100));
    rig.bus.acknowledged = false;
    const uint32_t purges = rig.bus.purges;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(90));
    TEST_ASSERT_EQUAL_UINT32(purges + 1U, rig.bus.purges);
    TEST_ASSERT_FALSE(rig.gateway.left_behind);
}

TEST(test_gateway_what_was_only_refused_is_not_asked_back) {
    gateway_rig_run(&rig, MS(1100));
    rig.bus.send_result[IW_LEFT] = rig.bus.send_result[IW_RIGHT] = 0;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.purges);
}
