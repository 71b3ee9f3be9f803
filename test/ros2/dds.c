// SPDX-License-Identifier: MIT
// The node itself, without a bridge: what it opens, as the kernel reports it.
#include "common/reach.h"
#include "ros.h"

#include "unity.h"

#include <stdlib.h>
#include <unistd.h>

static ros_settings_t settings;
static ros_t *ros;

void setUp(void) {
    ros_settings_default(&settings);
    settings.ros.domain = 1U + (uint32_t)getpid() % 230U;
}

void tearDown(void) {
    if (ros != NULL) {
        ros_close(ros);
    }
    ros = NULL;
}

static void test_dds_node_on_loopback_is_not_reached_from_outside(void) {
    char text[BRIDGE_REACH_TEXT];
    ros = ros_open(&settings, NULL, NULL, stderr);
    TEST_ASSERT_NOT_NULL(ros);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, bridge_reach_count(NULL, 0, text), text);
}

static void test_dds_node_on_a_network_is_reached_from_outside(void) {
    char text[BRIDGE_REACH_TEXT];
    settings.ros.loopback = false;
    (void)setenv("CYCLONEDDS_URI", "<General><AllowMulticast>false</AllowMulticast></General>", 1);
    ros = ros_open(&settings, NULL, NULL, stderr);
    TEST_ASSERT_NOT_NULL(ros);
    TEST_ASSERT_GREATER_THAN_UINT(0, bridge_reach_count(NULL, 0, text));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_dds_node_on_loopback_is_not_reached_from_outside);
    RUN_TEST(test_dds_node_on_a_network_is_reached_from_outside);
    return UNITY_END();
}
