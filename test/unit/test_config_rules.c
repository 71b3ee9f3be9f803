// SPDX-License-Identifier: MIT
// Values in the configuration file that would violate a safety rule are refused with key, rule, value and permitted
// range.
#include "test_config_rig.h"

#include "unit.h"

#include <stdlib.h>
#include <string.h>

/// Checks that the printed configuration is accepted and has the same values.
static void assert_fixed_point(void) {
    const uint16_t rest_rpm = config.core.rest_rpm;
    char *text = printed(&config);
    accepted(text);
    TEST_ASSERT_EQUAL_UINT16(rest_rpm, config.core.rest_rpm);
    free(text);
}

/// A refusal names the key, the rule, the written value and the permitted range.
TEST(test_parse_value_against_a_rule_is_refused_with_the_rule) {
    static const struct {
        const char *line, *rule, *permitted;
    } rows[] = {
        {"[drive]\nmax_current_mA = 0\n", "rule R15, with less a loaded wheel", "write 300..2000 mA"},
        {"[drive]\nmax_current_mA = 299\n", "rule R15, with less a loaded wheel", "write 300..2000 mA"},
        {"[limits]\nfollow_mm_s = 5000\n", "rule R13, a wheel that runs away", "write 50..500 mm/s"},
        {"[limits]\nfollow_ms = 5000\n", "rule R13, a wheel that runs away", "write 100..1000 ms"},
        {"[limits]\nblocked_ms = 10000\n", "rule R13, a blocked wheel", "write 200..2000 ms"},
        {"[limits]\npair_mm = 151\n", "rule R14, a machine that turns", "write 20..150 mm"},
        {"[limits]\npair_leak_ms = 499\n", "rule R14, a machine that turns", "write 500..3000 ms"},
        {"[wheels]\nradius_mm = 20\n", "rule R15, a wrong radius", "write 60..400 mm"},
        {"[limits]\nrest_rpm = 3\n", "rule R15, a wheel that rolls", "write 0..2 rpm, or leave the key out to have 2"},
        {"[limits]\nrest_rpm = 20\n", "rule R15, a wheel that rolls", "write 0..2 rpm, or leave the key out to have 2"},
        {"[drive]\nmin_current_mA = 2000\nmax_current_mA = 1999\n", "rule R15, no limit of a client",
         "max_current_mA = 2000 at least"},
        {"[limits]\nrest_rpm = 1001\n", "rule R15, a wheel that rolls", "write 0..1000 rpm"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char where[64];
        (void)snprintf(where, sizeof where, "iw.conf:2: %.*s", (int)strcspn(strchr(rows[i].line, '\n') + 1, "\n"),
                       strchr(rows[i].line, '\n') + 1);
        refused(rows[i].line, where, rows[i].rule);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(messages, rows[i].permitted), messages);
    }
}

/// Without a value rest_rpm follows from radius and gear, in any order of the keys. A configured value is checked against
/// them.
TEST(test_parse_rest_rpm_depends_on_radius_and_gear) {
    accepted("[limits]\nrest_ms = 300\n[wheels]\nradius_mm = 60\n");
    TEST_ASSERT_EQUAL_UINT16(7, config.core.rest_rpm);
    accepted("[wheels]\nradius_mm = 400\n");
    TEST_ASSERT_EQUAL_UINT16(1, config.core.rest_rpm);
    accepted("[wheels]\nrpm_of = rotor\ngear_ratio = 27/2\n");
    TEST_ASSERT_EQUAL_UINT16(30, config.core.rest_rpm);
    accepted("[wheels]\nradius_mm = 60\n[limits]\nrest_rpm = 9\n");
    TEST_ASSERT_EQUAL_UINT16(9, config.core.rest_rpm);
    assert_fixed_point();
    refused("[limits]\nrest_rpm = 10\n[wheels]\nradius_mm = 60\n", "iw.conf:2: rest_rpm = 10 is more than 60 mm/s",
            "radius_mm = 60: rule R15");
    refused("[wheels]\nradius_mm = 400\n[limits]\nrest_rpm = 2\n", "iw.conf:4: ", "write 0..1 rpm");
}

TEST(test_parse_second_contact_must_be_another_line_of_same_kind) {
    accepted("[estop]\nline = A\nline2 = B\n");
    accepted("[estop]\nline = unix:/a\nline2 = unix:/b\n");
    accepted("[estop]\nline = none\nline2 = none\n");
    accepted("[estop]\nline2 = B\ndebounce_ms = 199\n");
    accepted("[estop]\ndebounce_ms = 1000\n");
    refused("[estop]\nline = A\nline2 = A\n", "iw.conf:3: line and line2 are both A", "line2 = none");
    refused("[estop]\nline = unix:/a\nline2 = unix:/a\n", "iw.conf:3: line and line2 are both", "line2 = none");
    refused("[estop]\nline2 = ESTOP\n", "iw.conf:2: line and line2 are both ESTOP", "line2 = none");
    refused("[estop]\nline = none\nline2 = B\n", "iw.conf:3: line2 = B but line = none", "first contact");
    refused("[estop]\nline = unix:/a\nline2 = B\n", "iw.conf:3: line = unix:/a and line2 = B", "simulated");
    refused("[estop]\nline = A\nline2 = unix:/b\n", "iw.conf:3: line = A and line2 = unix:/b", "simulated");
    refused("[estop]\nline2 = B\ndebounce_ms = 200\n", "estop_discrepancy_ms = 200", "debounce_ms = 200");
    refused("[estop]\nline2 = B\nestop_discrepancy_ms = 50\ndebounce_ms = 60\n", "iw.conf:3: ", "shorter debounce_ms");
}
