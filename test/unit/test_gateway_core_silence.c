// SPDX-License-Identifier: MIT
// Silence after the zeros: setpoints that are still in a controller are withdrawn or reported.
#include "test_gateway_core_rig.h"
#include "unit.h"

/// Switches both wheels: without power they neither acknowledge nor send.
static void set_power(bool on) {
    rig.bus.acknowledged = on;
    set_mute(!on);
}

/// Drives, and runs until the last pair is echoed.
static void drive_on_and_echo(void) {
    drive_on();
    gateway_rig_run(&rig, MS(1));
}

/// Runs to the step that ends the zeros of a stop.
static void run_to_silence(void) {
    for (unsigned n = 0; n < 70000U && (rig.gateway.permit.phase == IW_PHASE_CUT || state() == IW_STATE_STOPPING);
         n++) {
        gateway_rig_run(&rig, 1000);
    }
    TEST_ASSERT_FALSE(rig.gateway.permit.phase == IW_PHASE_CUT || state() == IW_STATE_STOPPING);
}

/// Cuts the power in motion. Ends with the zeros.
static void cut_power_in_motion(int purge_result) {
    drive_on_and_echo();
    rig.bus.purge_result = purge_result;
    set_power(false);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    run_to_silence();
}

/// Without acknowledgement the zeros of an arm stay in the controller. Ends when the gateway withdraws the arm.
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

/// Restores the power: nothing that was sent before may reach the wheels.
static void expect_silence_with_power(void) {
    const iw_time_us_t commanded_us[IW_SIDES] = {rig.bus.commanded_us[IW_LEFT], rig.bus.commanded_us[IW_RIGHT]};
    const uint32_t sent = rig.bus.sent;
    set_power(true);
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_UINT64(commanded_us[IW_LEFT], rig.bus.commanded_us[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT64(commanded_us[IW_RIGHT], rig.bus.commanded_us[IW_RIGHT]);
    TEST_ASSERT_EQUAL_UINT32(sent, rig.bus.sent);
}

TEST(test_gateway_missing_echo_latches_and_purges) {
    drive_on_and_echo();
    const uint32_t sent = rig.bus.sent;
    rig.bus.acknowledged = false;
    (void)gateway_rig_cruise(&rig, 400, 400, MS(50));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_EQUAL_UINT32(sent + 2U, rig.bus.sent);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(50));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_SEND_STALLED, stop()->cause);
    TEST_ASSERT_UINT32_WITHIN(20, 60, stop()->detail);
    for (unsigned n = 0; n < 1100U && rig.gateway.permit.phase == IW_PHASE_CUT; n++) {
        TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
        TEST_ASSERT_FALSE(rig.gateway.left_behind);
        gateway_rig_run(&rig, MS(10));
    }
    TEST_ASSERT_FALSE(rig.gateway.permit.phase == IW_PHASE_CUT);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(sent + 4U, rig.bus.sent);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_purged_frames_are_never_sent) {
    drive_on_and_echo();
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

TEST(test_gateway_zeros_without_power_are_purged_at_their_end) {
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

TEST(test_gateway_zeros_of_a_failed_arm_are_purged) {
    arm_in_vain(1);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.flights);
    expect_silence_with_power();
    gateway_rig_arm(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
}

TEST(test_gateway_zeros_after_a_crash_are_purged_at_their_end) {
    gateway_rig_begin(&rig, true);
    rig.bus.purge_result = 1;
    set_power(false);
    run_to_silence();
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(2, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.flights);
    expect_silence_with_power();
}

TEST(test_gateway_zeros_after_a_crash_are_purged_once_before_end) {
    gateway_rig_begin(&rig, true);
    set_power(false);
    gateway_rig_run(&rig, MS(1400));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, state());
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_reset_during_zeros_purges_unechoed_frames) {
    drive_on_and_echo();
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

TEST(test_gateway_ordinary_stop_does_not_purge) {
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

/// Sends the zeros of an arm that is withdrawn immediately after them.
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

TEST(test_gateway_setpoint_is_purged_exactly_after_echo_ms) {
    const iw_time_us_t overdue_us = leave_young_zeros();
    gateway_rig_run(&rig, overdue_us - 1U - rig.now_us);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.purges);
    gateway_rig_run(&rig, 1);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_setpoint_is_not_purged_during_a_backlog) {
    const iw_time_us_t overdue_us = leave_young_zeros();
    gateway_rig_run(&rig, overdue_us - 1U - rig.now_us);
    rig.now_us = overdue_us;
    rig.bus.flood = IW_GATEWAY_DRAIN_MAX;
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.purges);
    gateway_rig_step(&rig);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_setpoint_is_purged_in_a_late_step) {
    const iw_time_us_t overdue_us = leave_young_zeros();
    gateway_rig_stall(&rig, overdue_us + MS(50) - rig.now_us);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_purge_without_result_is_repeated_every_second) {
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

TEST(test_gateway_failed_purge_is_reported_immediately) {
    arm_in_vain(-1);
    TEST_ASSERT_TRUE(rig.gateway.left_behind);
    gateway_rig_run(&rig, MS(10000));
    TEST_ASSERT_TRUE(rig.gateway.left_behind);
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.left_behind);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.purges);
}

TEST(test_gateway_purge_without_result_is_reported_at_repetition) {
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

TEST(test_gateway_purge_that_succeeds_later_is_not_reported) {
    arm_in_vain(0);
    rig.bus.purge_result = 1;
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_EQUAL_UINT32(1, rig.gateway.counters.purges);
    TEST_ASSERT_EQUAL_UINT32(0, rig.gateway.counters.left_behind);
}

TEST(test_gateway_failed_arm_after_a_stop_is_purged_once) {
    gateway_rig_arm(&rig);
    gateway_rig_stop(&rig);
    run_to_silence();
    TEST_ASSERT_NOT_EQUAL_UINT32(rig.gateway.purged_stop, stop()->number);
    arm_in_vain(0);
    TEST_ASSERT_EQUAL_UINT32(1, rig.bus.purges);
}

TEST(test_gateway_setpoint_is_purged_in_the_first_second) {
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

TEST(test_gateway_left_behind_ends_by_echo_bus_loss_or_purge) {
    for (unsigned n = 0; n < 3U; n++) {
        setUp();
        arm_in_vain(-1);
        TEST_ASSERT_TRUE(rig.gateway.left_behind);
        if (n == 0U) {
            rig.bus.acknowledged = true;
        } else if (n == 1U) {
            fake_bus_break(&rig.bus, IW_BUS_ACTIVE); // Bus down and up again
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

/// Each silence is separate: a purge of the last silence or of the zeros does not count for this one.
TEST(test_gateway_purge_of_the_next_silence_is_separate) {
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

TEST(test_gateway_refused_setpoints_are_not_purged) {
    gateway_rig_run(&rig, MS(1100));
    rig.bus.send_result[IW_LEFT] = rig.bus.send_result[IW_RIGHT] = 0;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, state());
    TEST_ASSERT_EQUAL_UINT32(0, rig.bus.purges);
}
