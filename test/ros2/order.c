// SPDX-License-Identifier: MIT
// The order of what comes from ROS in one wake-up: the bridge's own code and the gateway's own loop in virtual time (hours_rig.h). ROS is this
// file: one command and one request may wait when the bridge looks.
#include "bridge.h"
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

// ---- instead of DDS -------------------------------------------------------------------------------------------------

ros_t *ros_open(const ros_settings_t *wanted, ros_came_t came, void *context, FILE *err) {
    (void)wanted;
    (void)came;
    (void)context;
    (void)err;
    return (ros_t *)&bridge; // Only compared with NULL.
}

void ros_close(ros_t *self) {
    (void)self;
}

void ros_woken(ros_t *self) {
    (void)self;
}

bool ros_take_command(ros_t *self, ros_command_t *out_command) {
    const bool was = has_command;
    (void)self;
    *out_command = command;
    has_command = false;
    return was;
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

// ---- what comes -----------------------------------------------------------------------------------------------------

static void command_comes(double v_m_s) {
    command = (ros_command_t){.linear = {v_m_s, 0.0, 0.0}, .source = 1, .sent_us = hours_wall_ns() / 1000};
    has_command = true;
}

static void request_comes(ros_verb_t verb) {
    request = (ros_request_t){.verb = verb, .source = 2, .sent_us = hours_wall_ns() / 1000};
    has_request = true;
    answered = false;
}

static void pass(unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += PASS_MS) {
        const iw_time_us_t until_us = daemon_rig.now_us + MS(PASS_MS);
        bridge_step(&bridge); // May have waited.
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
    daemon_rig_begin();
    ros_settings_default(&settings);
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
    TEST_ASSERT_TRUE(answered && !success); // The gateway knows the intention from before: stale_command.
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.told_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static void test_ros_stop_that_came_with_a_command_stops(void) {
    arm();
    for (unsigned i = 0; i < 10U; i++) {
        command_comes(0.3);
        pass(20);
    }
    TEST_ASSERT_GREATER_THAN_INT16(0, daemon_rig.told_mm_s[IW_LEFT]);
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
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.told_mm_s[IW_LEFT]);
}

static void test_ros_estop_latches_and_reset_is_not_for_the_network(void) {
    request_comes(ROS_ESTOP);
    pass(3000); // The gateway itself would take a reset now.
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
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.told_mm_s[IW_LEFT]);
}

static void test_ros_arm_takes_no_lease_from_another_client(void) {
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
    request.sent_us -= 5000000;
    pass(200);
    TEST_ASSERT_TRUE(answered && !success);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static void test_ros_command_that_arms_does_not_drive(void) {
    bridge.settings.drive.auto_arm = true;
    pass(3000);
    command_comes(0.3);
    pass(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_EQUAL_UINT64(0, bridge.facts.commands.passed);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.told_mm_s[IW_LEFT]);
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
    RUN_TEST(test_ros_arm_takes_no_lease_from_another_client);
    RUN_TEST(test_ros_arm_that_was_late_is_refused);
    RUN_TEST(test_ros_command_that_arms_does_not_drive);
    RUN_TEST(test_ros_bridge_that_only_watches_does_not_arm);
    return UNITY_END();
}
