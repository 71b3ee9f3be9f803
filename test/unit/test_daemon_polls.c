// SPDX-License-Identifier: MIT
// Daemon: what wakes the loop, and what it polls before a setpoint is sent, in virtual time.
#include "daemon_client.h"

#include "unit.h"

#include <string.h>
#include <unistd.h>

/// Starts driving and stops between two pairs, so that only the next request is due.
static void begin_driving_between_pairs(void) {
    daemon_rig_begin_driving(client);
    while (daemon_rig.now_us - daemon_rig.sent_us != MS(8)) {
        daemon_rig_run(1);
    }
    daemon_rig.most_mm_s = 0;
}

#define SLOWER "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}\n"

TEST(test_estop_pressed_before_wake_latches_before_next_setpoint) {
    for (unsigned phase = 0; phase < 20U; phase++) {
        daemon_rig_begin_driving(client);
        daemon_rig_run(phase);
        daemon_rig.most_mm_s = 0;
        daemon_rig_send(client, SLOWER);
        daemon_rig.estop_silent = phase % 2U == 1U;
        daemon_rig.estop = (phase % 4U < 2U) ? 1 : -1;
        daemon_rig_run(1);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        TEST_ASSERT_TRUE(daemon_rig_commands_zero());
        TEST_ASSERT_EQUAL_INT(0, daemon_rig.most_mm_s);
        tearDown();
        setUp();
    }
}

TEST(test_estop_pulse_after_wake_latches_before_next_setpoint) {
    begin_driving_between_pairs();
    daemon_rig.estop_late = true;
    daemon_rig_send(client, SLOWER);
    daemon_rig_run(1);
    TEST_ASSERT_FALSE(daemon_rig.estop_late);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_EQUAL_INT(0, daemon_rig.most_mm_s);
}

TEST(test_command_of_the_holder_is_sent_after_one_poll) {
    begin_driving_between_pairs();
    const uint32_t polls = daemon_rig.polls;
    const uint32_t sent = daemon_rig.sent[IW_LEFT];
    daemon_rig_send(client, SLOWER);
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_UINT32(polls + 1U, daemon_rig.polls);
    TEST_ASSERT_EQUAL_UINT32(sent + 1U, daemon_rig.sent[IW_LEFT]);
    TEST_ASSERT_TRUE(daemon_rig.most_mm_s < 500);
}

TEST(test_wait_reads_the_clock_only_while_setpoints_are_sent) {
    daemon_rig_run(100);
    TEST_ASSERT_TRUE(daemon_rig.wait_from_us > 0U);
    daemon_rig_begin_driving(client);
    TEST_ASSERT_EQUAL_UINT64(0, daemon_rig.wait_from_us);
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    daemon_rig_run(1000);
    TEST_ASSERT_EQUAL_UINT64(0, daemon_rig.wait_from_us);
    daemon_rig_run(5000);
    TEST_ASSERT_TRUE(daemon_rig.wait_from_us > 0U);
}

TEST(test_poll_is_not_just_before_a_setpoint_and_within_3_ms) {
    begin_driving_between_pairs();
    for (unsigned ms = 0; ms < 150U; ms++) {
        const uint32_t sent = daemon_rig.sent[IW_LEFT];
        daemon_rig_run(1);
        TEST_ASSERT_TRUE(daemon_rig.now_us - daemon_rig.polled_us <= MS(3));
        TEST_ASSERT_TRUE(daemon_rig.sent[IW_LEFT] == sent || daemon_rig.unpolled_us >= MS(2));
    }
}

/// Checks that the command is refused because it was sent before the stop.
static void assert_refused_behind_a_stop(void) {
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_EQUAL_INT(0, daemon_rig.most_mm_s);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    const char *reply = daemon_rig_receive(client);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "\"ok\":false"), reply);
}

TEST(test_command_that_waited_during_a_stall_is_refused) {
    begin_driving_between_pairs();
    daemon_rig_send(client, SLOWER);
    daemon_rig.stolen_us = 150000U;
    daemon_rig_run(1);
    assert_refused_behind_a_stop();
    daemon_rig_run(4000);
    begin_driving_between_pairs();
    daemon_rig_send(client, SLOWER);
    daemon_rig.suspended_us += 150000U;
    daemon_rig_run(1);
    assert_refused_behind_a_stop();
}

TEST(test_command_together_with_the_estop_is_refused) {
    daemon_rig_begin_driving(client);
    daemon_rig.estop = 1;
    assert_reply("{\"cmd\":\"drive\",\"left_mm_s\":500,\"right_mm_s\":500}", "\"ok\":false");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
}

static uint32_t waits_in_a_second(void) {
    daemon_rig_run(100);
    daemon_rig.waits = 0;
    daemon_rig_run(1000);
    return daemon_rig.waits;
}

TEST(test_frames_without_watcher_are_read_in_groups) {
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(230, waits_in_a_second());
    (void)close(client);
    client = -1;
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(230, waits_in_a_second());
}

TEST(test_frames_with_watcher_are_read_one_by_one) {
    (void)daemon_rig_ask(client, "{\"cmd\":\"watch\",\"topics\":[\"frame\"]}");
    TEST_ASSERT_GREATER_THAN_UINT32(450, waits_in_a_second());
}

TEST(test_frames_are_read_in_groups_if_armed_singly_in_a_stop) {
    daemon_rig_begin_driving(client);
    daemon_rig.waits = 0;
    daemon_rig_run(190);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(90, daemon_rig.waits);
    daemon_rig.estop = 1;
    daemon_rig_run(1);
    daemon_rig.waits = 0;
    daemon_rig_run(1000);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_GREATER_THAN_UINT32(450, daemon_rig.waits);
}

TEST(test_foreign_setpoint_latches_within_4_ms_while_frames_wait) {
    for (unsigned phase = 0; phase < 20U; phase++) {
        daemon_rig_begin_driving(client);
        daemon_rig_run(phase);
        TEST_ASSERT_TRUE(daemon_rig.daemon->loop.frames_wait);
        const iw_time_us_t before_us = daemon_rig.now_us;
        daemon_rig.rx[daemon_rig.rx_count++] =
            (iw_can_frame_t){.id = IW_ID_LEFT_SETPOINT, .dlc = 5, .kind = IW_CAN_RECEIVED};
        daemon_rig_run(4);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        TEST_ASSERT_TRUE(daemon_rig_commands_zero());
        TEST_ASSERT_TRUE(daemon_rig.sent_us - before_us <= MS(4));
        tearDown();
        setUp();
    }
}

TEST(test_estop_wakes_the_loop_while_frames_wait) {
    (void)close(client);
    client = -1;
    daemon_rig_run(100);
    for (unsigned phase = 0; phase < 10U; phase++) {
        daemon_rig_run(7);
        const iw_time_us_t before_us = daemon_rig.now_us;
        daemon_rig.estop = (daemon_rig.estop == 0) ? 1 : 0;
        daemon_rig_run(1);
        TEST_ASSERT_EQUAL_INT(daemon_rig.estop, daemon_rig.estop_reported);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        TEST_ASSERT_TRUE(daemon_rig.now_us - before_us <= MS(1));
    }
}
