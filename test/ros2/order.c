// SPDX-License-Identifier: MIT
// The order of messages from ROS in one wake-up: the bridge's own code and the gateway's own loop in virtual time (hours_rig.h). This file
// replaces ROS: one command and one request may wait when the bridge polls.
#include "bridge_parts.h"
#include "hours_rig.h"

#include "unity.h"

#include <string.h>
#include <unistd.h>

#define PASS_MS 5U

static bridge_t bridge;
static ros_settings_t settings;
static ros_command_t command;
static bool has_command;
static ros_request_t request;
static bool has_request;
static bool answered;
static bool success;
static int estop_shown;
static unsigned estop_count;

// ---- instead of DDS -------------------------------------------------------------------------------------------------

ros_t *ros_open(const ros_settings_t *wanted, ros_came_t came, void *context, FILE *err) {
    (void)wanted;
    (void)came;
    (void)context;
    (void)err;
    return (ros_t *)&bridge; // The bridge only compares it with NULL.
}

void ros_close(ros_t *self) {
    (void)self;
}

void ros_woken(ros_t *self) {
    (void)self;
}

bool ros_take_command(ros_t *self, unsigned reader, ros_command_t *out_command) {
    const bool was = has_command && reader == 0U;
    (void)self;
    *out_command = command;
    has_command = has_command && !was;
    return was;
}

void ros_find_unmatched(ros_t *self, ros_unmatched_t *out) {
    (void)self;
    memset(out, 0, sizeof *out);
}

void ros_publish_estop(ros_t *self, bool pressed) {
    (void)self;
    estop_shown = pressed ? 1 : 0;
    estop_count++;
}

unsigned ros_publishers(const ros_t *self) {
    (void)self;
    return 1;
}

bool ros_take_request(ros_t *self, ros_request_t *out_request) {
    const bool was = has_request;
    (void)self;
    *out_request = request;
    has_request = false;
    return was;
}

void ros_answer(ros_t *self, const ros_request_t *asked, bool good, const char *text) {
    (void)self;
    (void)asked;
    (void)text;
    answered = true;
    success = good;
}

void ros_publish_motion(ros_t *self, const ros_machine_t *machine, const ros_odometry_t *odometry) {
    (void)self;
    (void)machine;
    (void)odometry;
}

void ros_publish_wrench(ros_t *self, const ros_machine_t *machine) {
    (void)self;
    (void)machine;
}

void ros_publish_battery(ros_t *self, const ros_machine_t *machine) {
    (void)self;
    (void)machine;
}

void ros_publish_diagnostics(ros_t *self, const ros_status_t *statuses, int64_t wall_us) {
    (void)self;
    (void)statuses;
    (void)wall_us;
}

void ros_publish_state(ros_t *self, const char *json) {
    (void)self;
    (void)json;
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
        bridge_step(&bridge); // The step may have waited.
        if (daemon_rig.now_us < until_us) {
            hours_run_gateway((unsigned)((until_us - daemon_rig.now_us + 999U) / IW_US_PER_MS));
        }
    }
}

static void arm(void) {
    request_comes(ROS_ARM);
    pass(200);
    TEST_ASSERT_TRUE(answered && success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

void setUp(void) {
    has_command = has_request = answered = success = false;
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
    for (unsigned i = 0; i < 10U; i++) {
        command_comes(0.3);
        pass(20);
    }
    TEST_ASSERT_GREATER_THAN_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    command_comes(0.3);
    request_comes(ROS_STOP);
    pass(2000);
    TEST_ASSERT_TRUE(answered && success);
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

static void test_ros_silent_source_stops_before_the_lease_ends(void) {
    bridge.settings.drive.timeout_ms = 100;
    arm();
    for (unsigned i = 0; i < 10U; i++) {
        command_comes(0.3);
        pass(20);
    }
    pass(150);
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_STOP, gw_wheels_look(&daemon_rig.daemon->wheels).stop->cause);
}

static void test_ros_command_that_was_late_is_not_passed(void) {
    arm();
    for (unsigned i = 0; i < 5U; i++) {
        command_comes(0.0);
        pass(20);
    }
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

static void test_ros_lease_that_ended_unseen_is_nobodys(void) {
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
    for (unsigned i = 0; i < 20U; i++) {
        command_comes(0.3);
        pass(20);
    }
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
    RUN_TEST(test_ros_lease_that_ended_unseen_is_nobodys);
    RUN_TEST(test_ros_other_machine_without_synchronised_clock_cannot_arm);
    RUN_TEST(test_ros_other_machine_drives_when_its_clock_is_known);
    RUN_TEST(test_ros_command_of_unknown_clock_does_not_arm);
    RUN_TEST(test_ros_command_that_arms_does_not_drive);
    RUN_TEST(test_ros_request_that_cannot_be_read_only_stops);
    RUN_TEST(test_ros_stop_at_rest_ends_arming_by_commands);
    RUN_TEST(test_ros_bridge_that_only_watches_does_not_arm);
    return UNITY_END();
}
