// SPDX-License-Identifier: MIT
// The order of messages from ROS in one wake-up: the bridge's own code and the gateway's own loop in virtual time (hours_rig.h).
#include "bridge_parts.h"
#include "hours_rig.h"

#include "unity.h"

#include <string.h>
#include <unistd.h>

#define PASS_MS 5U

#include "fake_ros.inc"

static bool why_is_lost;

iwc_result_t __real_iwc_ask(iwc_t *self, const char *line, int timeout_ms, iwc_message_t *out_reply);
iwc_result_t __wrap_iwc_ask(iwc_t *self, const char *line, int timeout_ms, iwc_message_t *out_reply);

/// Loses the reply to `why`, as a slow or disturbed serial line does.
iwc_result_t __wrap_iwc_ask(iwc_t *self, const char *line, int timeout_ms, iwc_message_t *out_reply) {
    const bool lost = why_is_lost && strstr(line, "\"why\"") != NULL;
    return lost ? IWC_TIMEOUT : __real_iwc_ask(self, line, timeout_ms, out_reply);
}

// ---- messages -------------------------------------------------------------------------------------------------------

static void command_comes(double v_m_s) {
    command = (ros_command_t){.linear = {v_m_s, 0.0, 0.0}, .source = 1, .sent_us = hours_wall_ns() / 1000};
    has_command = true;
}

static void request_comes(ros_verb_t verb) {
    request =
        (ros_request_t){.verb = verb, .source = 2, .sent_us = hours_wall_ns() / 1000, .caller.form = ROS_FORM_IDENTITY};
    has_request = true;
    answered = false;
}

static void pass(unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += PASS_MS) {
        const iw_time_us_t until_us = daemon_rig.now_us + MS(PASS_MS);
        const int64_t before_us = bridge.received_us;
        bridge_step(&bridge); // The step may have waited.
        snapshot_count += (bridge.received_us != before_us) ? 1U : 0U;
        if (daemon_rig.now_us < until_us) {
            hours_run_gateway((unsigned)((until_us - daemon_rig.now_us + 999U) / IW_US_PER_MS));
        }
    }
}

static void commands_come(double v_m_s, unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        command_comes(v_m_s);
        pass(20);
    }
}

static void arm(void) {
    request_comes(ROS_ARM);
    pass(200);
    TEST_ASSERT_TRUE(answered && success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

void setUp(void) {
    has_command = has_request = answered = success = is_used = why_is_lost = false;
    estop_shown = -1;
    estop_count = 0;
    daemon_rig_begin();
    settings = ros_settings_standard;
    settings.drive.enabled = true;
    TEST_ASSERT_EQUAL_INT(0, bridge_open(&bridge, &settings));
    pass(1000);
}

void tearDown(void) {
    bridge_close(&bridge);
    (void)pthread_mutex_unlock(&bridge.lock);
    daemon_rig_end();
}

// ---- tests ----------------------------------------------------------------------------------------------------------

static void test_ros_command_that_came_with_arm_prevents_it(void) {
    command_comes(0.3);
    request_comes(ROS_ARM);
    pass(300);
    TEST_ASSERT_TRUE(answered && !success); // The gateway has seen the earlier commands: stale_command.
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static void test_ros_stop_that_came_with_a_command_stops(void) {
    arm();
    commands_come(0.3, 10);
    TEST_ASSERT_GREATER_THAN_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    command_comes(0.3);
    request_comes(ROS_STOP);
    pass(2000);
    TEST_ASSERT_TRUE(answered && success);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

static void test_ros_silent_source_stops_before_the_lease_ends(void) {
    bridge.settings.drive.timeout_ms = 100;
    arm();
    commands_come(0.3, 10);
    pass(150);
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_STOP, gw_wheels_snapshot(&daemon_rig.daemon->wheels).stop->cause);
}

static void test_ros_command_that_was_late_is_not_passed(void) {
    arm();
    commands_come(0.0, 5);
    const uint64_t passed = bridge.facts.commands.passed;
    command_comes(0.3);
    command.sent_us -= 5000000;
    pass(20);
    TEST_ASSERT_EQUAL_UINT64(passed, bridge.facts.commands.passed);
    TEST_ASSERT_EQUAL_UINT64(1, bridge.facts.commands.late);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
}

static void test_ros_estop_latches_and_reset_is_not_for_the_network(void) {
    request_comes(ROS_ESTOP);
    pass(3000); // The gateway itself would accept a reset now.
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    request_comes(ROS_RESET);
    pass(500);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
}

static void test_ros_command_with_an_old_header_is_not_passed(void) {
    arm();
    for (unsigned i = 0; i < 5U; i++) {
        command_comes(0.0);
        command.stamp_us = command.sent_us;
        pass(20);
    }
    command_comes(0.3);
    command.stamp_us = command.sent_us - 5000000;
    pass(20);
    TEST_ASSERT_EQUAL_UINT64(1, bridge.facts.commands.late);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
}

static void test_ros_estop_topic_shows_the_line_once_for_each_change(void) {
    TEST_ASSERT_EQUAL_INT(0, estop_shown);
    daemon_rig.estop = 1;
    pass(300);
    TEST_ASSERT_EQUAL_INT(1, estop_shown);
    daemon_rig.estop = 0;
    pass(300);
    TEST_ASSERT_EQUAL_INT(0, estop_shown);
    daemon_rig.estop = -1;
    pass(300);
    TEST_ASSERT_EQUAL_INT(1, estop_shown);
    TEST_ASSERT_EQUAL_UINT(4, estop_count);
    daemon_rig.estop = 0;
    pass(300);
    bridge_step(&bridge); // This step reads the waiting messages.
    TEST_ASSERT_EQUAL_INT(0, estop_shown);
    (void)snprintf(bridge.facts.machine.estop, sizeof bridge.facts.machine.estop, "none");
    bridge.facts.link = ROS_LINK_SILENT;
    bridge_step(&bridge);
    TEST_ASSERT_EQUAL_INT(1, estop_shown); // A line that has disappeared counts as unreadable.
}

static void test_ros_arm_moves_no_lease_of_another_client(void) {
    const int other = daemon_rig_connect();
    daemon_rig_arm(other);
    request_comes(ROS_ARM);
    pass(100);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_FALSE(bridge.facts.machine.now.ours);
    (void)close(other);
}

static void test_ros_arm_that_was_late_is_refused(void) {
    arm();
    request_comes(ROS_STOP);
    pass(3000);
    request_comes(ROS_ARM);
    request.sent_us -= 600000; // The gateway would accept it.
    pass(200);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static void test_ros_first_command_of_a_minute_ago_moves_nothing(void) {
    arm();
    for (unsigned i = 0; i < 40U; i++) {
        command_comes(0.3);
        command.source = 100U + i; // A different writer for each.
        command.sent_us -= 60000000;
        pass(20);
    }
    TEST_ASSERT_EQUAL_UINT64(0, bridge.facts.commands.passed);
    TEST_ASSERT_EQUAL_UINT64(40, bridge.facts.commands.late);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
}

static void test_ros_first_request_of_a_minute_ago_is_refused(void) {
    bridge.settings.drive.allow_reset = true;
    request_comes(ROS_ARM);
    request.sent_us -= 60000000;
    pass(200);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    request_comes(ROS_ESTOP);
    pass(3000);
    request_comes(ROS_RESET);
    request.sent_us -= 60000000;
    pass(200);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
}

static void test_ros_stop_of_a_minute_ago_stops(void) {
    arm();
    command_comes(0.3);
    pass(20);
    request_comes(ROS_STOP);
    request.sent_us -= 60000000;
    pass(100);
    TEST_ASSERT_TRUE(answered && success);
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

static void test_ros_reset_means_a_stop_that_was_shown_for_a_second(void) {
    bridge.settings.drive.allow_reset = true;
    request_comes(ROS_ESTOP);
    pass(3000);
    request_comes(ROS_STOP); // This is no new stop.
    pass(100);
    bridge.shown_us = bridge_monotonic_us() - 900000;
    request_comes(ROS_RESET);
    pass(20);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    pass(200);
    bridge.shown.value++; // This reset belongs to another stop.
    request_comes(ROS_RESET);
    pass(20);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    bridge.shown.value--;
    request_comes(ROS_RESET);
    pass(100);
    TEST_ASSERT_TRUE(answered && success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static void test_ros_arm_from_before_a_stop_is_refused_by_the_gateway(void) {
    const int other = daemon_rig_connect();
    daemon_rig_ask(other, "{\"cmd\":\"stop\",\"id\":1}");
    pass(100);
    request_comes(ROS_ARM);
    request.sent_us -= 200000; // Recent enough, but sent before that stop.
    pass(200);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    (void)close(other);
}

static void test_ros_arm_while_a_dropped_command_moves_is_refused(void) {
    command_comes(0.3);
    command.sent_us -= 5000000; // The gateway does not receive it.
    pass(300);
    request_comes(ROS_ARM);
    pass(100);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    pass(500);
    arm();
}

// ---- two publishers -------------------------------------------------------------------------------------------------

static void command_comes_of(uint64_t source, double v_m_s) {
    command_comes(v_m_s);
    command.source = source;
    pass(20);
}

static void test_ros_one_person_drives_of_two_that_publish(void) {
    arm();
    for (unsigned i = 0; i < 20U; i++) {
        command_comes_of(1, 0.3);
        command_comes_of(2, -0.3);
        TEST_ASSERT_GREATER_OR_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    }
    TEST_ASSERT_EQUAL_UINT64(20, bridge.facts.commands.passed);
    TEST_ASSERT_EQUAL_UINT64(20, bridge.facts.commands.others);
    TEST_ASSERT_GREATER_THAN_INT16(100, daemon_rig.commanded_mm_s[IW_LEFT]);
}

static void test_ros_one_person_has_the_wheels_until_they_are_stopped(void) {
    arm();
    command_comes_of(2, 0.0); // Zeros do not take over.
    command_comes_of(1, 0.3);
    for (unsigned i = 0; i < 50U; i++) { // Zeros of the first publisher renew the lease; those of the second do not.
        command_comes_of(1, 0.0);
        command_comes_of(2, 0.0);
    }
    TEST_ASSERT_EQUAL_UINT64(52, bridge.facts.commands.passed);
    request_comes(ROS_ARM);
    command_comes_of(1, 0.0);
    TEST_ASSERT_TRUE(answered && !success); // Busy.
    command_comes_of(2, 0.3);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    request_comes(ROS_STOP);
    pass(3000);
    arm();
    command_comes_of(2, 0.3);
    command_comes_of(2, 0.3);
    TEST_ASSERT_GREATER_THAN_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
}

static void test_ros_one_person_without_the_lease_has_nothing(void) {
    command_comes_of(1, 0.3); // Not armed: it is refused, and no publisher has the wheels.
    pass(1000);
    arm();
    for (unsigned i = 0; i < 3U; i++) {
        command_comes_of(2, 0.3);
    }
    TEST_ASSERT_GREATER_THAN_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    pass(3000); // The lease ends on its own.
    TEST_ASSERT_EQUAL_UINT64(0, bridge.driver);
    arm();
    for (unsigned i = 0; i < 3U; i++) {
        command_comes_of(1, 0.3);
    }
    TEST_ASSERT_GREATER_THAN_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
}

static void test_ros_lease_that_ended_unseen_has_no_holder(void) {
    arm();
    command_comes_of(1, 0.3);
    command_comes_of(1, 0.0);
    pass(3000);
    arm();
    command_comes_of(1, 0.001); // Less than the smallest command of a wheel, and not zero.
    bridge.driver = 1;
    const int other = daemon_rig_connect();
    daemon_rig_ask(other, "{\"cmd\":\"stop\",\"id\":1}");
    pass(400);
    TEST_ASSERT_EQUAL_UINT64(0, bridge.driver);
    (void)close(other);
}

// ---- writers on other machines ----------------------------------------------------------------------------------------

static void on_a_network(bool synchronised) {
    bridge_close(&bridge);
    (void)pthread_mutex_unlock(&bridge.lock);
    settings.ros.loopback = false;
    settings.ros.synchronised = synchronised;
    TEST_ASSERT_EQUAL_INT(0, bridge_open(&bridge, &settings));
    pass(1000);
}

static void test_ros_other_machine_without_synchronised_clock_cannot_arm(void) {
    on_a_network(false);
    request_comes(ROS_ARM);
    pass(200);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    on_a_network(true);
    arm();
}

static void test_ros_other_machine_drives_when_its_clock_is_known(void) {
    on_a_network(true);
    arm();
    commands_come(0.3, 20);
    TEST_ASSERT_EQUAL_UINT64(20, bridge.facts.commands.unknown);
    TEST_ASSERT_EQUAL_UINT64(0, bridge.facts.commands.passed);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    for (unsigned i = 0; i < 60U; i++) { // Zeros pass, and the bridge learns from them.
        command_comes(0.0);
        pass(20);
    }
    TEST_ASSERT_EQUAL_UINT64(60, bridge.facts.commands.passed);
    command_comes(0.3);
    pass(40);
    TEST_ASSERT_EQUAL_UINT64(61, bridge.facts.commands.passed);
    TEST_ASSERT_GREATER_THAN_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
}

static void test_ros_command_of_unknown_clock_does_not_arm(void) {
    settings.drive.auto_arm = true;
    on_a_network(false);
    command_comes(0.0);
    pass(100);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static void test_ros_command_that_arms_does_not_drive(void) {
    bridge.settings.drive.auto_arm = true;
    pass(3000);
    command_comes(0.3);
    pass(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_EQUAL_UINT64(0, bridge.facts.commands.passed);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
}

static void test_ros_request_that_cannot_be_read_only_stops(void) {
    request_comes(ROS_ARM);
    request.caller.form = ROS_FORM_UNREADABLE;
    pass(200);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    arm();
    request_comes(ROS_STOP);
    request.caller.form = ROS_FORM_UNREADABLE;
    pass(100);
    TEST_ASSERT_TRUE(answered && success);
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

static void test_ros_stop_at_rest_ends_arming_by_commands(void) {
    bridge.settings.drive.auto_arm = true;
    pass(3000);
    request_comes(ROS_STOP);
    pass(1000);
    for (unsigned i = 0; i < 100U; i++) {
        command_comes(0.3);
        pass(50);
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    pass(1100);
    command_comes(0.3);
    pass(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

static void test_ros_bridge_that_only_watches_does_not_arm(void) {
    bridge.facts.drive = false;
    request_comes(ROS_ARM);
    pass(200);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static unsigned snapshots_in(unsigned for_ms) {
    const unsigned before = snapshot_count;
    pass(for_ms);
    return snapshot_count - before;
}

static void test_ros_rate_of_snapshots_falls_without_a_node(void) {
    pass(500);
    TEST_ASSERT_UINT_WITHIN(2, 40, snapshots_in(2000));
    is_used = true;
    pass(200);
    TEST_ASSERT_UINT_WITHIN(2, 50, snapshots_in(1000));
    is_used = false;
    TEST_ASSERT_UINT_WITHIN(2, 40, snapshots_in(800)); // A node that returns within a second finds the full rate.
    pass(500);
    const unsigned motions = motion_count;
    TEST_ASSERT_UINT_WITHIN(2, 20, snapshots_in(1000));
    TEST_ASSERT_EQUAL_UINT(motions, motion_count);
    is_used = true;
    pass(150);
    TEST_ASSERT_GREATER_THAN_UINT(motions, motion_count);
    TEST_ASSERT_TRUE(bridge.facts.commands.refused == 0U && bridge.facts.link == ROS_LINK_UP);
}

static void test_ros_rate_of_snapshots_is_full_with_the_lease(void) {
    arm();
    commands_come(0.0, 100);
    const unsigned before = snapshot_count;
    commands_come(0.0, 50);
    TEST_ASSERT_UINT_WITHIN(2, 50, snapshot_count - before);
}

/// A person has stopped the wheels while the bridge was away. Without the reply to `why` it must not conclude that there was no stop.
static void test_ros_lost_reply_about_the_last_stop_is_no_connection(void) {
    const int other = daemon_rig_connect();
    why_is_lost = true;
    iwc_close(bridge.gateway);
    pass(20);
    (void)daemon_rig_ask(other, "{\"cmd\":\"estop\"}");
    pass(2000);
    TEST_ASSERT_EQUAL_INT(ROS_LINK_GONE, bridge.facts.link);
    why_is_lost = false;
    pass(4000);
    TEST_ASSERT_EQUAL_INT(ROS_LINK_UP, bridge.facts.link);
    TEST_ASSERT_TRUE(bridge.facts.machine.stop_number.known);
    TEST_ASSERT_NOT_NULL(strstr(bridge.facts.machine.stop, "software e-stop"));
    (void)close(other);
}

/// All places of the gateway are in use, one of them by the driver, when the bridge has lost its connection.
static void test_ros_stop_reaches_a_full_gateway_without_a_connection(void) {
    sock_clients_t *clients = &daemon_rig.daemon->clients;
    for (unsigned i = 0; i < 2U; i++) {
        const int other = daemon_rig_connect();
        daemon_rig_arm(other);
        iwc_close(bridge.gateway);
        pass(20);
        clients->most[SOCK_DRIVE] = clients->most[SOCK_WATCH] = 1;
        pass(100);
        TEST_ASSERT_EQUAL_INT(ROS_LINK_GONE, bridge.facts.link);
        daemon_rig_drive(other, 300, 300, 100);
        request_comes((i == 0U) ? ROS_STOP : ROS_ESTOP);
        pass(20);
        TEST_ASSERT_TRUE(answered && success);
        TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
        (void)close(other);
        clients->most[SOCK_DRIVE] = clients->most[SOCK_WATCH] = 4;
        pass(3000);
        TEST_ASSERT_EQUAL_INT(ROS_LINK_UP, bridge.facts.link);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_ros_command_that_came_with_arm_prevents_it);
    RUN_TEST(test_ros_stop_that_came_with_a_command_stops);
    RUN_TEST(test_ros_silent_source_stops_before_the_lease_ends);
    RUN_TEST(test_ros_command_that_was_late_is_not_passed);
    RUN_TEST(test_ros_estop_latches_and_reset_is_not_for_the_network);
    RUN_TEST(test_ros_command_with_an_old_header_is_not_passed);
    RUN_TEST(test_ros_estop_topic_shows_the_line_once_for_each_change);
    RUN_TEST(test_ros_arm_moves_no_lease_of_another_client);
    RUN_TEST(test_ros_arm_that_was_late_is_refused);
    RUN_TEST(test_ros_first_command_of_a_minute_ago_moves_nothing);
    RUN_TEST(test_ros_first_request_of_a_minute_ago_is_refused);
    RUN_TEST(test_ros_stop_of_a_minute_ago_stops);
    RUN_TEST(test_ros_reset_means_a_stop_that_was_shown_for_a_second);
    RUN_TEST(test_ros_arm_from_before_a_stop_is_refused_by_the_gateway);
    RUN_TEST(test_ros_arm_while_a_dropped_command_moves_is_refused);
    RUN_TEST(test_ros_one_person_drives_of_two_that_publish);
    RUN_TEST(test_ros_one_person_has_the_wheels_until_they_are_stopped);
    RUN_TEST(test_ros_one_person_without_the_lease_has_nothing);
    RUN_TEST(test_ros_lease_that_ended_unseen_has_no_holder);
    RUN_TEST(test_ros_other_machine_without_synchronised_clock_cannot_arm);
    RUN_TEST(test_ros_other_machine_drives_when_its_clock_is_known);
    RUN_TEST(test_ros_command_of_unknown_clock_does_not_arm);
    RUN_TEST(test_ros_command_that_arms_does_not_drive);
    RUN_TEST(test_ros_request_that_cannot_be_read_only_stops);
    RUN_TEST(test_ros_stop_at_rest_ends_arming_by_commands);
    RUN_TEST(test_ros_bridge_that_only_watches_does_not_arm);
    RUN_TEST(test_ros_rate_of_snapshots_falls_without_a_node);
    RUN_TEST(test_ros_rate_of_snapshots_is_full_with_the_lease);
    RUN_TEST(test_ros_lost_reply_about_the_last_stop_is_no_connection);
    RUN_TEST(test_ros_stop_reaches_a_full_gateway_without_a_connection);
    return UNITY_END();
}
