// SPDX-License-Identifier: MIT
// The bridge's configuration file: each error with its line and cure, nothing half read.
#include "settings.h"

#include "unity.h"

#include <stdlib.h>
#include <string.h>

static ros_settings_t settings;
static char *told;
static size_t told_size;

void setUp(void) {
    memset(&settings, 0x55, sizeof settings);
}

void tearDown(void) {
    free(told);
    told = NULL;
}

static int read_text(const char *text) {
    char copy[4096];
    (void)snprintf(copy, sizeof copy, "%s", text);
    FILE *in = fmemopen(copy, strlen(copy), "r");
    FILE *err = open_memstream(&told, &told_size);
    const int result = ros_settings_read(in, "f", &settings, err);
    (void)fclose(in);
    (void)fclose(err);
    return result;
}

static void test_settings_empty_sections_are_the_defaults(void) {
    TEST_ASSERT_EQUAL_INT(0, read_text("; nothing\n"));
    TEST_ASSERT_EQUAL_STRING("/run/iwheel/gateway.sock", settings.gateway.socket);
    TEST_ASSERT_TRUE(settings.drive.enabled);
    TEST_ASSERT_FALSE(settings.drive.auto_arm || settings.drive.allow_reset || settings.odometry.tf);
    TEST_ASSERT_EQUAL_UINT32(500, settings.drive.timeout_ms);
    TEST_ASSERT_EQUAL_STRING("", settings.ros.ns);
}

static void test_settings_all_keys_are_read(void) {
    TEST_ASSERT_EQUAL_INT(
        0, read_text("[gateway]\nsocket = /tmp/x\n[ros]\ndomain=7\nnetwork = loopback\nrelease = humble\n"
                     "namespace = /w1\nnode = base ; comment\n[drive]\nenabled = no\n"
                     "command = twist_stamped\n  timeout_ms = 50\nauto_arm = yes\nallow_reset = yes\n"
                     "[odometry]\nrate_hz = 100\nodom_frame = w1/odom\nbase_frame = b\ntf = yes\n"));
    TEST_ASSERT_EQUAL_STRING("/tmp/x", settings.gateway.socket);
    TEST_ASSERT_EQUAL_UINT32(7, settings.ros.domain);
    TEST_ASSERT_TRUE(settings.ros.loopback && settings.ros.humble && settings.drive.stamped);
    TEST_ASSERT_EQUAL_STRING("w1", settings.ros.ns);
    TEST_ASSERT_EQUAL_STRING("base", settings.ros.node);
    TEST_ASSERT_FALSE(settings.drive.enabled);
    TEST_ASSERT_EQUAL_UINT32(50, settings.drive.timeout_ms);
    TEST_ASSERT_TRUE(settings.drive.auto_arm && settings.drive.allow_reset && settings.odometry.tf);
    TEST_ASSERT_EQUAL_STRING("w1/odom", settings.odometry.odom_frame);
}

static void test_settings_each_error_names_line_and_cure(void) {
    const struct {
        const char *text;
        const char *words;
    } cases[] = {
        {"[drive]\ntimeout_ms = 501\n", "f:2: timeout_ms = 501 is no whole number from 50 to 500; write one"},
        {"[drive]\ntimeout_ms = -1\n", "f:2: timeout_ms = -1 is no whole number"},
        {"[drive]\ntimeout_ms = 1e2\n", "f:2: timeout_ms = 1e2 is no whole number"},
        {"[drive]\nauto_arm = maybe\n", "f:2: auto_arm = maybe is not known; write no or yes"},
        {"[drive]\nautoarm = yes\n", "f:2: unknown key autoarm in [drive]; known are: enabled, command"},
        {"[ros]\nauto_arm = yes\n", "f:2: auto_arm is no key of [ros]; move it to [drive]"},
        {"[rose]\nx = 1\n", "f:2: unknown section [rose]; known are: gateway, ros, drive, odometry"},
        {"[ros]\n\ndomain = 1\ndomain = 2\n", "f:4: domain is here a second time (first on line 3); keep one"},
        {"[ros]\nnamespace = 9w\n", "f:2: namespace = 9w is no name for ROS"},
        {"[ros]\nnode = a b\n", "f:2: node = a b is no name for ROS"},
        {"[ros]\nnode =\n", "f:2: node has 0 characters; write 1 to 64"},
        {"[ros]\ndomain\n", "f:2: \"domain\" is not KEY = VALUE; add the '='"},
        {"[ros]\ndomain = 233\n", "from 0 to 232"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        TEST_ASSERT_EQUAL_INT(ROS_SETTINGS_ERROR, read_text(cases[i].text));
        if (strstr(told, cases[i].words) == NULL) {
            TEST_FAIL_MESSAGE(told);
        }
        TEST_ASSERT_EQUAL_HEX8(0x55, settings.gateway.socket[0]);
        tearDown();
    }
}

static void test_settings_one_error_does_not_hide_the_next(void) {
    TEST_ASSERT_EQUAL_INT(ROS_SETTINGS_ERROR, read_text("[drive]\nauto_arm = 1\nallow_reset = 1\n"));
    TEST_ASSERT_NOT_NULL(strstr(told, "f:2:"));
    TEST_ASSERT_NOT_NULL(strstr(told, "f:3:"));
}

static void test_settings_line_too_long_is_refused(void) {
    char text[400];
    (void)snprintf(text, sizeof text, "[gateway]\nsocket = /%0250d\n", 1);
    TEST_ASSERT_EQUAL_INT(ROS_SETTINGS_ERROR, read_text(text));
    TEST_ASSERT_NOT_NULL(strstr(told, "f:2: is longer than"));
}

static void test_settings_what_is_printed_reads_back_the_same(void) {
    char *printed = NULL;
    size_t size = 0;
    TEST_ASSERT_EQUAL_INT(0, read_text("[ros]\nnamespace = w1\n[drive]\nauto_arm = yes\n"));
    const ros_settings_t before = settings;
    FILE *out = open_memstream(&printed, &size);
    ros_settings_print(&settings, out);
    (void)fclose(out);
    tearDown();
    TEST_ASSERT_EQUAL_INT(0, read_text(printed));
    TEST_ASSERT_EQUAL_MEMORY(&before, &settings, sizeof before);
    free(printed);
}

static void test_settings_shipped_file_is_the_defaults(void) {
    ros_settings_t standard;
    ros_settings_default(&standard);
    TEST_ASSERT_EQUAL_INT(0, ros_settings_load(IWHEEL_SHARE_DIR "/ros2.conf", &settings, stderr));
    TEST_ASSERT_EQUAL_MEMORY(&standard, &settings, sizeof standard);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_settings_empty_sections_are_the_defaults);
    RUN_TEST(test_settings_all_keys_are_read);
    RUN_TEST(test_settings_each_error_names_line_and_cure);
    RUN_TEST(test_settings_one_error_does_not_hide_the_next);
    RUN_TEST(test_settings_line_too_long_is_refused);
    RUN_TEST(test_settings_what_is_printed_reads_back_the_same);
    RUN_TEST(test_settings_shipped_file_is_the_defaults);
    return UNITY_END();
}
