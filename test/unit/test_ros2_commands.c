// SPDX-License-Identifier: MIT
// Which commands from ROS pass: numbers, and when the bridge may arm automatically.
#include "commands.h"

#include "unit.h"

#include <math.h>

#define SECOND 1000000

static ros_auto_t automatic;

void setUp(void) {
    ros_auto_init(&automatic, 0);
}

// ---- numbers ------------------------------------------------------------------------------------------------------

static ros_twist_verdict_t read_twist(double v, double yaw, ros_twist_t *out) {
    const double linear[3] = {v, 0, 0};
    const double angular[3] = {0, 0, yaw};
    return ros_twist_read(linear, angular, out);
}

TEST(test_twist_metres_and_radians_become_thousandths) {
    ros_twist_t twist;
    TEST_ASSERT_EQUAL(ROS_TWIST_GOOD, read_twist(0.2496, -1.0004, &twist));
    TEST_ASSERT_EQUAL_INT32(250, twist.v_mm_s);
    TEST_ASSERT_EQUAL_INT32(-1000, twist.yaw_mrad_s);
}

TEST(test_twist_with_any_value_not_finite_is_refused_completely) {
    const double bad[] = {NAN, INFINITY, -INFINITY};
    for (unsigned i = 0; i < 3U; i++) {
        for (unsigned place = 0; place < 6U; place++) {
            double vectors[2][3] = {{0.1, 0, 0}, {0, 0, 0.1}};
            ros_twist_t twist = {11, 12};
            vectors[place / 3U][place % 3U] = bad[i];
            TEST_ASSERT_EQUAL(ROS_TWIST_NO_NUMBER, ros_twist_read(vectors[0], vectors[1], &twist));
            TEST_ASSERT_EQUAL_INT32(11, twist.v_mm_s);
            TEST_ASSERT_EQUAL_INT32(12, twist.yaw_mrad_s);
        }
    }
}

TEST(test_twist_beyond_every_range_is_refused) {
    ros_twist_t twist;
    TEST_ASSERT_EQUAL(ROS_TWIST_TOO_LARGE, read_twist(1e30, 0, &twist));
    TEST_ASSERT_EQUAL(ROS_TWIST_TOO_LARGE, read_twist(0, -1e30, &twist));
    TEST_ASSERT_EQUAL(ROS_TWIST_TOO_LARGE, read_twist(32.768, 0, &twist));
    TEST_ASSERT_EQUAL(ROS_TWIST_GOOD, read_twist(32.767, -32.767, &twist));
}

// ---- automatic arming ---------------------------------------------------------------------------------------------

TEST(test_auto_arm_first_command_after_a_pause_requests_once) {
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, true, ROS_QUIET_US - 1));
    setUp();
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, true, ROS_QUIET_US));
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, true, ROS_QUIET_US + 20000));
}

TEST(test_auto_arm_zeros_for_the_quiet_time_request_the_lease) {
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, true, 100000));
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 100000 + ROS_QUIET_US - 1));
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, false, 100000 + ROS_QUIET_US));
}

TEST(test_auto_arm_stream_without_zeros_never_requests) {
    for (int64_t t = 0; t < 60LL * SECOND; t += 100000) {
        TEST_ASSERT_FALSE(ros_auto_command(&automatic, true, t));
    }
}

TEST(test_auto_arm_foreign_stop_waits_for_the_service) {
    ros_auto_stopped(&automatic, false);
    ros_auto_stopped(&automatic, true);
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, SECOND));
    ros_auto_reported(&automatic);
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, false, 3LL * SECOND));
}

/// Sends commands at 20 Hz in this time; returns how many of them request the lease.
static unsigned stream(int64_t from_us, int64_t until_us) {
    unsigned asks = 0;
    for (int64_t t = from_us; t < until_us; t += SECOND / 20) {
        asks += ros_auto_command(&automatic, true, t) ? 1U : 0U;
    }
    return asks;
}

TEST(test_auto_arm_stream_after_an_operator_stop_does_not_request) {
    ros_auto_person_stopped(&automatic);
    TEST_ASSERT_EQUAL_UINT(0, stream(5LL * SECOND, 65LL * SECOND)); // Also after a pause: the stop came last.
    TEST_ASSERT_EQUAL_UINT(0, stream(65LL * SECOND + ROS_SILENT_US - 50000 - 1, 70LL * SECOND));
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 70LL * SECOND));
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, true, 70LL * SECOND + ROS_SILENT_US));
}

TEST(test_auto_arm_operator_stop_ends_by_the_service) {
    ros_auto_person_stopped(&automatic);
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 2LL * SECOND));
    ros_auto_reported(&automatic);
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, false, 2LL * SECOND + 50000));
}

TEST(test_auto_arm_second_operator_stop_restarts_the_wait) {
    ros_auto_person_stopped(&automatic);
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 2LL * SECOND));
    ros_auto_person_stopped(&automatic);
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 4LL * SECOND));
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, false, 6LL * SECOND));
}

TEST(test_auto_arm_operator_stop_does_not_end_the_service_wait) {
    ros_auto_stopped(&automatic, false);
    ros_auto_person_stopped(&automatic);
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 2LL * SECOND));
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 4LL * SECOND));
    setUp();
    ros_auto_person_stopped(&automatic);
    ros_auto_stopped(&automatic, false); // The event of the gateway on it: the wheels turned.
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 2LL * SECOND));
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, 4LL * SECOND));
}

TEST(test_auto_arm_own_lease_lost_needs_no_service) {
    ros_auto_stopped(&automatic, true);
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, false, SECOND));
}

TEST(test_auto_arm_refused_by_the_gateway_requests_again_later) {
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, false, SECOND));
    TEST_ASSERT_FALSE(ros_auto_command(&automatic, false, SECOND + ROS_QUIET_US - 1));
    TEST_ASSERT_TRUE(ros_auto_command(&automatic, false, SECOND + ROS_QUIET_US));
}
