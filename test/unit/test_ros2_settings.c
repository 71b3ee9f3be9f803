// SPDX-License-Identifier: MIT
// The configuration file of the bridge to ROS 2: each error with its line and fix.
#include "ros_settings.h"

#include "unit.h"

#include <stdlib.h>
#include <string.h>

static ros_settings_t settings;
static char *messages;
static size_t printed_size;

void setUp(void) {
    settings = ros_settings_standard;
}

void tearDown(void) {
    free(messages);
    messages = NULL;
}

static int read_text(const char *text) {
    settings_report_t report = {.name = "f", .err = open_memstream(&messages, &printed_size)};
    const int result = settings_parse(&ros_settings_form, &report, text, strlen(text), &settings);
    (void)fclose(report.err);
    return result;
}

TEST(test_settings_empty_sections_are_the_defaults) {
    TEST_ASSERT_EQUAL_INT(0, read_text("; nothing\n"));
    TEST_ASSERT_EQUAL_STRING("/run/iwheel/gateway.sock", settings.gateway.socket);
    TEST_ASSERT_TRUE(settings.drive.enabled);
    TEST_ASSERT_FALSE(settings.drive.auto_arm || settings.drive.allow_reset || settings.odometry.tf);
    TEST_ASSERT_EQUAL_UINT32(500, settings.drive.timeout_ms);
    TEST_ASSERT_EQUAL_STRING("", ros_settings_space(&settings));
}

TEST(test_settings_all_keys_are_read) {
    TEST_ASSERT_EQUAL_INT(
        0, read_text("[gateway]\nsocket = /tmp/x\n[ros]\ndomain=7\nnetwork = loopback\nrelease = humble\n"
                     "namespace = w1\nnode = base ; a comment\n[drive]\nenabled = no\n"
                     "command = twist_stamped\n  timeout_ms = 50\nauto_arm = yes\nallow_reset = yes\n"
                     "[odometry]\nrate_hz = 100\nodom_frame = w1/odom\nbase_frame = b\ntf = yes\n"));
    TEST_ASSERT_EQUAL_STRING("/tmp/x", settings.gateway.socket);
    TEST_ASSERT_EQUAL_UINT32(7, settings.ros.domain);
    TEST_ASSERT_TRUE(settings.ros.loopback && settings.ros.humble && settings.drive.command == ROS_COMMAND_STAMPED);
    TEST_ASSERT_EQUAL_STRING("w1", ros_settings_space(&settings));
    TEST_ASSERT_EQUAL_STRING("base", settings.ros.node);
    TEST_ASSERT_FALSE(settings.drive.enabled);
    TEST_ASSERT_EQUAL_UINT32(50, settings.drive.timeout_ms);
    TEST_ASSERT_TRUE(settings.drive.auto_arm && settings.drive.allow_reset && settings.odometry.tf);
    TEST_ASSERT_EQUAL_STRING("w1/odom", settings.odometry.odom_frame);
}

TEST(test_settings_each_error_names_line_and_fix) {
    const struct {
        const char *text;
        const char *words;
    } cases[] = {
        {"[drive]\ntimeout_ms = 501\n", "50..500 ms"},
        {"[drive]\nauto_arm = maybe\n", "no or yes"},
        {"[drive]\nautoarm = yes\n", "did you mean auto_arm"},
        {"[ros]\nauto_arm = yes\n", "move it to [drive]"},
        {"[ros]\nnamespace = 9w\n", "is not a valid name for ROS"},
        {"[ros]\nnamespace = /w\n", "is not a valid name for ROS"},
        {"[ros]\nnode = a b\n", "is not a valid name for ROS"},
        {"[ros]\ndomain = 233\n", "0..232"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        TEST_ASSERT_EQUAL_INT(SETTINGS_ERROR, read_text(cases[i].text));
        if (strncmp(messages, "f:2: ", 5) != 0 || strstr(messages, cases[i].words) == NULL) {
            TEST_FAIL_MESSAGE(messages);
        }
        tearDown();
    }
}

TEST(test_settings_printed_file_is_read_back_unchanged) {
    char *printed = NULL;
    size_t size = 0;
    TEST_ASSERT_EQUAL_INT(0, read_text("[ros]\nnamespace = w1\n[drive]\nauto_arm = yes\n"));
    const ros_settings_t before = settings;
    FILE *out = open_memstream(&printed, &size);
    settings_print(&ros_settings_form, &settings, &ros_settings_standard, NULL, out);
    (void)fclose(out);
    tearDown();
    setUp();
    TEST_ASSERT_EQUAL_INT(0, read_text(printed));
    TEST_ASSERT_EQUAL_MEMORY(&before, &settings, sizeof before);
    free(printed);
}

TEST(test_settings_shipped_file_is_the_defaults) {
    TEST_ASSERT_EQUAL_INT(0, settings_load(&ros_settings_form, IWHEEL_SHARE_DIR "/ros2.conf", &settings, stderr));
    TEST_ASSERT_EQUAL_MEMORY(&ros_settings_standard, &settings, sizeof settings);
}
