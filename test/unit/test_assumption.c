// SPDX-License-Identifier: MIT
// Texts of the assumptions: the configured value, the comparison with a found value, and the cost of a contradiction.
#include "inspect/assumption.h"

#include "iwheel_northbound/words.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>

static iw_config_t config;
static inspect_configured_t configured = {&config, 540};
static char text[INSPECT_SOURCE_SIZE];

void setUp(void) {
    iw_config_default(&config);
    configured.track_mm = 540;
    config.setpoint_type_set = true;
    config.setpoint_type = 7;
    config.current_role = IW_ROLE_SETPOINT;
    config.invert[IW_RIGHT] = true;
    config.gear_turns = 10;
    config.gear_per = 3;
    config.rpm_of_rotor = true;
}

static void assert_value(iw_assumption_item_t item, const char *expected) {
    char value[IWN_VALUE_SIZE];
    memset(value, 0x5A, sizeof value);
    inspect_assumption_value(&configured, item, value);
    TEST_ASSERT_EQUAL_STRING(expected, value);
}

static void assert_found(inspect_found_t expected, iw_assumption_item_t item, const char *found) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected, inspect_assumption_compare(&configured, item, found), found);
}

TEST(test_assumption_value_equals_the_configuration) {
    assert_value(IW_ASSUMPTION_SETPOINT_TYPE, "7");
    assert_value(IW_ASSUMPTION_CURRENT_ROLE, "setpoint");
    assert_value(IW_ASSUMPTION_FORCE_UNIT_LEFT, "cN");
    assert_value(IW_ASSUMPTION_FORCE_UNIT_RIGHT, "dN");
    assert_value(IW_ASSUMPTION_MOUNT_SIGN_LEFT, "no");
    assert_value(IW_ASSUMPTION_MOUNT_SIGN_RIGHT, "yes");
    assert_value(IW_ASSUMPTION_WHEEL_RADIUS, "192");
    assert_value(IW_ASSUMPTION_TRACK, "540");
    assert_value(IW_ASSUMPTION_GEAR_RATIO, "10/3, rpm of the rotor");
    assert_value(IW_ASSUMPTION_OFFSET_INCLUDED, "yes");
    assert_value(IW_ASSUMPTION_DLC, "yes");
    iw_config_default(&config);
    assert_value(IW_ASSUMPTION_SETPOINT_TYPE, "");
    assert_value(IW_ASSUMPTION_CURRENT_ROLE, "");
    assert_value(IW_ASSUMPTION_GEAR_RATIO, "1, rpm of the wheel");
}

TEST(test_assumption_longest_value_fits) {
    config.gear_turns = 1000;
    config.gear_per = 999;
    assert_value(IW_ASSUMPTION_GEAR_RATIO, "1000/999, rpm of the rotor");
}

TEST(test_assumption_item_is_found_by_its_exact_name_only) {
    for (unsigned n = 0; n < IW_ASSUMPTION_ITEMS; n++) {
        iw_assumption_item_t item = IW_ASSUMPTION_ITEMS;
        TEST_ASSERT_TRUE(iwn_assumption_item_of(iwn_assumption_item_name((iw_assumption_item_t)n), &item));
        TEST_ASSERT_EQUAL_UINT(n, item);
    }
    iw_assumption_item_t item = IW_ASSUMPTION_ITEMS;
    TEST_ASSERT_FALSE(iwn_assumption_item_of("", &item));
    TEST_ASSERT_FALSE(iwn_assumption_item_of("unknown", &item));
    TEST_ASSERT_FALSE(iwn_assumption_item_of("wheel_radius ", &item));
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_ITEMS, item);
}

TEST(test_assumption_compare_without_value_is_same) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        assert_found(INSPECT_FOUND_SAME, (iw_assumption_item_t)item, "");
    }
}

TEST(test_assumption_compare_with_unset_configuration_is_unset) {
    iw_config_default(&config);
    assert_found(INSPECT_FOUND_UNSET, IW_ASSUMPTION_SETPOINT_TYPE, "");
    assert_found(INSPECT_FOUND_UNSET, IW_ASSUMPTION_SETPOINT_TYPE, "7");
    assert_found(INSPECT_FOUND_UNSET, IW_ASSUMPTION_CURRENT_ROLE, "limit");
}

TEST(test_assumption_numbers_compare_by_value) {
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_SETPOINT_TYPE, "7");
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_SETPOINT_TYPE, "007");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_SETPOINT_TYPE, "0");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_SETPOINT_TYPE, "255");
    static const char *const impossible[] = {"256", "-1", "7 ", "0x7", "99999", "4294967303", "seven"};
    for (size_t i = 0; i < sizeof impossible / sizeof impossible[0]; i++) {
        assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_SETPOINT_TYPE, impossible[i]);
    }
}

TEST(test_assumption_radius_within_two_percent_is_same) {
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_WHEEL_RADIUS, "192");
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_WHEEL_RADIUS, "195");
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_WHEEL_RADIUS, "189");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_WHEEL_RADIUS, "196");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_WHEEL_RADIUS, "188");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_WHEEL_RADIUS, "500");
    assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_WHEEL_RADIUS, "501");
    assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_WHEEL_RADIUS, "19");
}

TEST(test_assumption_track_within_two_percent_is_same) {
    configured.track_mm = 600;
    assert_value(IW_ASSUMPTION_TRACK, "600");
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_TRACK, "600");
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_TRACK, "588");
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_TRACK, "612");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_TRACK, "587");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_TRACK, "613");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_TRACK, "1500");
    assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_TRACK, "1501");
    assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_TRACK, "199");
}

TEST(test_assumption_gear_ratios_compare_as_ratios) {
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_GEAR_RATIO, "10/3");
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_GEAR_RATIO, "20/6");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_GEAR_RATIO, "10");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_GEAR_RATIO, "1000/999");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_GEAR_RATIO, "999/1000");
    static const char *const impossible[] = {"0", "1/0", "/3", "10/", "1001", "1/1001", "10/3, rpm of the rotor"};
    for (size_t i = 0; i < sizeof impossible / sizeof impossible[0]; i++) {
        assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_GEAR_RATIO, impossible[i]);
    }
}

TEST(test_assumption_strings_compare_exactly) {
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_FORCE_UNIT_RIGHT, "dN");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_FORCE_UNIT_RIGHT, "cN");
    assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_FORCE_UNIT_RIGHT, "DN");
    assert_found(INSPECT_FOUND_SAME, IW_ASSUMPTION_MOUNT_SIGN_RIGHT, "yes");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_MOUNT_SIGN_LEFT, "yes");
    assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_MOUNT_SIGN_LEFT, "true");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_CURRENT_ROLE, "limit");
    assert_found(INSPECT_FOUND_IMPOSSIBLE, IW_ASSUMPTION_CURRENT_ROLE, "torque");
    assert_found(INSPECT_FOUND_DIFFERENT, IW_ASSUMPTION_OFFSET_INCLUDED, "no");
}

TEST(test_assumption_source_text_contains_the_figure) {
    const inspect_word_t word = {"", ""};
    iw_assumption_entry_t entry = {IW_CONTRADICTED, IW_SOURCE_BUS, -1010};
    inspect_assumption_source(IW_ASSUMPTION_FORCE_UNIT_LEFT, &entry, &word, text);
    TEST_ASSERT_NOT_NULL(strstr(text, "-1.010"));
    entry.figure = INT32_MIN;
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        for (unsigned source = IW_SOURCE_NONE; source <= IW_SOURCE_OPERATOR; source++) {
            entry.source = (iw_source_t)source;
            inspect_assumption_source((iw_assumption_item_t)item, &entry, &word, text);
            TEST_ASSERT_GREATER_THAN_UINT(8, strlen(text));
            TEST_ASSERT_LESS_THAN_UINT(INSPECT_SOURCE_SIZE - 1U, strlen(text));
        }
    }
}

static void assert_word(iw_assumption_state_t state, const char *found, const char *how, const char *expected) {
    const iw_assumption_entry_t entry = {state, IW_SOURCE_OPERATOR, 0};
    inspect_word_t word;
    (void)snprintf(word.found, sizeof word.found, "%s", found);
    (void)snprintf(word.how, sizeof word.how, "%s", how);
    inspect_assumption_source(IW_ASSUMPTION_WHEEL_RADIUS, &entry, &word, text);
    TEST_ASSERT_EQUAL_STRING(expected, text);
}

TEST(test_assumption_source_text_contains_the_operators_value) {
    assert_word(IW_CONTRADICTED, "181", "", "the operator found 181");
    assert_word(IW_CONTRADICTED, "", "", "the operator found something else");
    assert_word(IW_CONFIRMED, "192", "", "confirmed by the operator");
}

TEST(test_assumption_source_text_contains_the_operators_method) {
    assert_word(IW_CONFIRMED, "192", "bringup: 5.00 m pushed", "found by bringup: 5.00 m pushed");
    assert_word(IW_CONTRADICTED, "181", "a tape", "the operator found 181 by a tape");
    assert_word(IW_CONTRADICTED, "", "a tape", "the operator found something else by a tape");
}

TEST(test_assumption_cost_names_arm_if_item_guards_motion) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        const char *cost = inspect_assumption_cost((iw_assumption_item_t)item);
        const bool refuses = strncmp(cost, "arm is refused; ", 16) == 0;
        TEST_ASSERT_EQUAL_INT_MESSAGE(refuses, iw_assumption_guards_motion((iw_assumption_item_t)item), cost);
        TEST_ASSERT_NOT_EQUAL(0, strcmp(cost, "unknown"));
    }
    TEST_ASSERT_TRUE(iw_assumption_guards_motion(IW_ASSUMPTION_MOUNT_SIGN_LEFT));
    TEST_ASSERT_FALSE(iw_assumption_guards_motion(IW_ASSUMPTION_DLC));
}
