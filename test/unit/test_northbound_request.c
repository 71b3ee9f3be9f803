// SPDX-License-Identifier: MIT
// One line of a client: which lines are requests, and which are refused completely, with which error name.

#include "iwheel_northbound/request.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>

static iwn_work_t work;
static iwn_request_t request;
static iwn_refusal_t refusal;

void setUp(void) {
    memset(&request, 0xA5, sizeof request);
    memset(&refusal, 0xA5, sizeof refusal);
}

static bool parse(const char *line) {
    return iwn_request_read(line, strlen(line), &work, &request, &refusal);
}

static void accepted(const char *line, iwn_cmd_t cmd) {
    TEST_ASSERT_TRUE_MESSAGE(parse(line), line);
    TEST_ASSERT_EQUAL_INT(cmd, request.cmd);
}

static void refused(iwn_error_t error, const char *line) {
    TEST_ASSERT_FALSE_MESSAGE(parse(line), line);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(iwn_error_name(error), iwn_error_name(refusal.error), line);
    TEST_ASSERT_TRUE(memchr(refusal.message, '\0', sizeof refusal.message) != NULL);
    TEST_ASSERT_TRUE(strlen(refusal.message) > 10U);
    for (const char *c = refusal.message; *c != '\0'; c++) {
        TEST_ASSERT_TRUE_MESSAGE(*c >= 0x20 && *c <= 0x7E, "a message must be printable");
    }
}

TEST(test_request_each_command_with_its_fields_is_accepted) {
    accepted("{\"cmd\":\"hello\"}", IWN_CMD_HELLO);
    accepted("{\"cmd\":\"status\",\"id\":1}", IWN_CMD_STATUS);
    accepted("{\"cmd\":\"watch\",\"topics\":[]}", IWN_CMD_WATCH);
    accepted("{\"cmd\":\"arm\"}", IWN_CMD_ARM);
    accepted("{\"cmd\":\"drive\",\"left_mm_s\":0,\"right_mm_s\":0}", IWN_CMD_DRIVE);
    accepted("{\"cmd\":\"twist\",\"v_mm_s\":0,\"yaw_mrad_s\":0}", IWN_CMD_TWIST);
    accepted("{\"cmd\":\"stop\"}", IWN_CMD_STOP);
    accepted("{\"cmd\":\"disarm\"}", IWN_CMD_DISARM);
    accepted("{\"cmd\":\"estop\"}", IWN_CMD_ESTOP);
    accepted("{\"cmd\":\"reset\"}", IWN_CMD_RESET);
    accepted("{\"cmd\":\"tare\"}", IWN_CMD_TARE);
    accepted("{\"cmd\":\"why\"}", IWN_CMD_WHY);
    accepted(" \t{ \"cmd\" : \"why\" } \r", IWN_CMD_WHY);
}

TEST(test_request_drive_numbers_are_read_exactly) {
    accepted("{\"cmd\":\"drive\",\"left_mm_s\":-32768,\"right_mm_s\":4294967496,\"left_mA\":-7,\"right_mA\":8}",
             IWN_CMD_DRIVE);
    TEST_ASSERT_EQUAL_INT64(-32768, request.left_mm_s);
    TEST_ASSERT_EQUAL_INT64(4294967496, request.right_mm_s);
    TEST_ASSERT_EQUAL_INT64(-7, request.left_mA);
    TEST_ASSERT_EQUAL_INT64(8, request.right_mA);
    TEST_ASSERT_TRUE(request.has_current);
    accepted("{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":2}", IWN_CMD_DRIVE);
    TEST_ASSERT_FALSE(request.has_current);
}

TEST(test_request_id_is_read_from_valid_json_with_other_errors) {
    accepted("{\"id\":-9007199254740993,\"cmd\":\"why\"}", IWN_CMD_WHY);
    TEST_ASSERT_EQUAL_INT(IWN_ID_NUMBER, request.id.kind);
    TEST_ASSERT_EQUAL_INT64(-9007199254740993, request.id.number);
    accepted("{\"id\":\"a \\\" b\",\"cmd\":\"why\"}", IWN_CMD_WHY);
    TEST_ASSERT_EQUAL_INT(IWN_ID_TEXT, request.id.kind);
    TEST_ASSERT_EQUAL_STRING("a \" b", request.id.text);
    refused(IWN_UNKNOWN_CMD, "{\"id\":5,\"cmd\":\"fly\"}");
    TEST_ASSERT_EQUAL_INT64(5, request.id.number);
    refused(IWN_UNKNOWN_FIELD, "{\"id\":6,\"cmd\":\"why\",\"now\":true}");
    TEST_ASSERT_EQUAL_INT64(6, request.id.number);
    refused(IWN_BAD_JSON, "{\"id\":7,");
    TEST_ASSERT_EQUAL_INT(IWN_ID_NONE, request.id.kind);
}

TEST(test_request_id_of_another_kind_is_refused) {
    refused(IWN_BAD_VALUE, "{\"id\":1.5,\"cmd\":\"why\"}");
    refused(IWN_BAD_VALUE, "{\"id\":null,\"cmd\":\"why\"}");
    refused(IWN_BAD_VALUE, "{\"id\":[1],\"cmd\":\"why\"}");
    refused(IWN_BAD_VALUE, "{\"id\":true,\"cmd\":\"why\"}");
    refused(IWN_BAD_VALUE, "{\"id\":\"a\\nb\",\"cmd\":\"why\"}");
    refused(IWN_BAD_VALUE,
            "{\"id\":\"aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa\",\"cmd\":\"why\"}");
}

TEST(test_request_confirm_accepts_item_value_and_how) {
    accepted("{\"cmd\":\"confirm\",\"item\":\"wheel_radius\",\"value\":192}", IWN_CMD_CONFIRM);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_WHEEL_RADIUS, request.item);
    TEST_ASSERT_EQUAL_STRING("192", request.value);
    accepted("{\"cmd\":\"confirm\",\"item\":\"gear_ratio\",\"value\":\"10/3\"}", IWN_CMD_CONFIRM);
    TEST_ASSERT_EQUAL_STRING("10/3", request.value);
    accepted("{\"cmd\":\"confirm\",\"item\":\"dlc\"}", IWN_CMD_CONFIRM);
    TEST_ASSERT_EQUAL_STRING("", request.value);
    accepted("{\"cmd\":\"confirm\",\"item\":\"dlc\",\"value\":-9223372036854775808}", IWN_CMD_CONFIRM);
    TEST_ASSERT_EQUAL_STRING("-9223372036854775808", request.value);
    TEST_ASSERT_EQUAL_STRING("", request.how);
    accepted("{\"cmd\":\"confirm\",\"item\":\"track\",\"value\":540,\"how\":\"bringup: 3 full turns\"}",
             IWN_CMD_CONFIRM);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_TRACK, request.item);
    TEST_ASSERT_EQUAL_STRING("bringup: 3 full turns", request.how);
    refused(IWN_BAD_VALUE, "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"how\":\"\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"how\":\"a\\nb\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"how\":3}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"reset\",\"how\":\"a tape\"}");
    refused(IWN_MISSING_FIELD, "{\"cmd\":\"confirm\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"confirm\",\"item\":\"speed\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"confirm\",\"item\":3}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"value\":1.5}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"value\":true}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"value\":\"\"}");
    refused(IWN_BAD_VALUE,
            "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"value\":\"1234567890123456789012345678901234567890\"}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"tare\",\"item\":\"dlc\"}");
}

TEST(test_request_not_one_object_is_bad_json) {
    static const char *const lines[] = {
        "",
        " ",
        "{",
        "}",
        "null",
        "17",
        "\"drive\"",
        "[{\"cmd\":\"why\"}]",
        "{\"cmd\":\"why\"}{\"cmd\":\"why\"}",
        "{\"cmd\":\"why\"} x",
        "{cmd:\"stop\"}",
        "{'cmd':'stop'}",
        "{\"cmd\":\"why\",}",
        "{\"cmd\":\"why\"",
        "{\"cmd\":\"why\",\"cmd\":\"why\"}",
        "{\"cmd\":\"drive\",\"left_mm_s\":1,\"left_mm_s\":2,\"right_mm_s\":1}",
        "{\"cmd\":\"drive\",\"left_mm_s\":1e999,\"right_mm_s\":1}",
        "{\"cmd\":\"drive\",\"left_mm_s\":NaN,\"right_mm_s\":1}",
        "{\"cmd\":\"drive\",\"left_mm_s\":Infinity,\"right_mm_s\":1}",
        "{\"cmd\":\"drive\",\"left_mm_s\":+1,\"right_mm_s\":1}",
        "{\"cmd\":\"drive\",\"left_mm_s\":01,\"right_mm_s\":1}",
        "{\"cmd\":\"drive\",\"left_mm_s\":0x10,\"right_mm_s\":1}",
        "{\"cmd\":\"drive\",\"left_mm_s\":99999999999999999999,\"right_mm_s\":1}",
        "{\"cmd\":\"arm\",\"name\":\"a\\u0000b\"}",
        "{\"cmd\":\"arm\",\"name\":\"\xC0\xAF\"}",
        "{\"cmd\":\"arm\",\"name\":\"\xED\xA0\x80\"}",
        "{\"cmd\":\"arm\",\"name\":\"\xF5\x80\x80\x80\"}",
        "{\"cmd\":\"arm\",\"name\":\"\xE2\x82\"}",
        "{\"cmd\":\"arm\",\"name\":\"\x01\"}",
        "\xEF\xBB\xBF{\"cmd\":\"why\"}",
    };
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        refused(IWN_BAD_JSON, lines[i]);
    }
}

TEST(test_request_nul_byte_anywhere_is_bad_json) {
    static const char line[] = "{\"cmd\":\"why\"}\0";
    TEST_ASSERT_FALSE(iwn_request_read(line, sizeof line - 1U, &work, &request, &refusal));
    TEST_ASSERT_EQUAL_INT(IWN_BAD_JSON, refusal.error);
    static const char inside[] = "{\"cmd\":\"st\0op\"}";
    TEST_ASSERT_FALSE(iwn_request_read(inside, sizeof inside - 1U, &work, &request, &refusal));
    TEST_ASSERT_EQUAL_INT(IWN_BAD_JSON, refusal.error);
}

// Stops in lines that are refused ------------------------------------------------------------------------------------

/// The line is refused as bad JSON, and this stop in it is executed.
static void assert_executed(iwn_cmd_t cmd, const char *line, size_t length) {
    TEST_ASSERT_TRUE_MESSAGE(iwn_request_read(line, length, &work, &request, &refusal), line);
    TEST_ASSERT_EQUAL_INT_MESSAGE(cmd, request.cmd, line);
    TEST_ASSERT_EQUAL_INT_MESSAGE(IWN_BAD_JSON, request.refused, line);
    TEST_ASSERT_EQUAL_INT(IWN_BAD_JSON, refusal.error);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(refusal.message, "; its stop is executed"), refusal.message);
    TEST_ASSERT_EQUAL_INT(IWN_ID_NONE, request.id.kind);
    TEST_ASSERT_FALSE(request.has_t_us || request.has_stop);
    TEST_ASSERT_EQUAL_STRING("", request.reason);
}

TEST(test_stop_never_refused_in_a_bad_line) {
    static const char *const lines[] = {
        "{\"cmd\":\"%s\",\"reason\":\"\\ud83d\"}",
        "{\"reason\":\"\\ud83d\",\"cmd\":\"%s\"}",
        "{\"reason\":\"a\\u0000b\",\"id\":7,\"cmd\":\"%s\"}",
        "{\"reason\":\"\xC3\x28\",\"cmd\":\"%s\"}",
        "{\"reason\":\"a\"b\",\"cmd\":\"%s\"}",
        "{\"reason\":\"a\\x\",\"cmd\":\"%s\"}",
        "{\"cmd\":\"%s\",\"reason\":\"a\tb\"}",
        "{\"cmd\":\"%s\",\"id\":1,\"id\":1}",
        "{\"cmd\":\"%s\",\"t_us\":1e999}",
        "{\"cmd\":\"%s\",\"t_us\":9223372036854775808}",
        "{\"cmd\":\"%s\",\"t_us\":NaN,}",
        "{\"cmd\":\"%s\",\"a\":[[[[[[[[1]]]]]]]]}",
        "{\"cmd\":\"%s\",\"reason\":\"never end",
        "{\"cmd\":\"%s\"",
        "{\"cmd\" \t: \t\"%s\",",
        "  \"cmd\": \"%s\",",
        "[{\"cmd\":\"%s\"}]",
        "\xEF\xBB\xBF{\"cmd\":\"%s\"}",
        "{\"cmd\":\"drive\",\"cmd\":\"%s\"}",
        "{\"cmd\":\"%s\",\"cmd\":\"arm\"}",
        "\"cmd\"\"cmd\":\"%s\"",
    };
    static const iwn_cmd_t cmds[] = {IWN_CMD_STOP, IWN_CMD_DISARM, IWN_CMD_ESTOP};
    static const char *const names[] = {"stop", "disarm", "estop"};
    char line[128];
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        for (size_t cmd = 0; cmd < 3U; cmd++) {
            (void)snprintf(line, sizeof line, lines[i], names[cmd]);
            assert_executed(cmds[cmd], line, strlen(line));
        }
    }
    static const char nul[] = "{\"cmd\":\"stop\"}\0";
    assert_executed(IWN_CMD_STOP, nul, sizeof nul - 1U);
    static const char behind[] = "\0{\"cmd\":\"stop\"}";
    assert_executed(IWN_CMD_STOP, behind, sizeof behind - 1U);
}

TEST(test_stop_never_replaces_an_estop_in_a_bad_line) {
    static const char both[] = "{\"cmd\":\"estop\"}{\"cmd\":\"stop\"}";
    assert_executed(IWN_CMD_ESTOP, both, sizeof both - 1U);
    static const char behind[] = "{\"cmd\":\"disarm\"}{\"cmd\":\"estop\"}";
    assert_executed(IWN_CMD_ESTOP, behind, sizeof behind - 1U);
}

TEST(test_request_bad_line_without_a_stop_stops_nothing) {
    static const char *const lines[] = {
        "{\"cmd\":\"stop",
        "{\"cmd\":\"stop,\"a\":1",
        "{\"cmd\":stop}",
        "{\"cmd\":\"stops\",}",
        "{\"cmd\":\"sto\",}",
        "{\"cmd\":\"Stop\",}",
        "{\"cmd\":\"\",}",
        "{\"cmd\",\"stop\"}",
        "{\"cmd\"\"stop\"}",
        "{\"cmds\":\"stop\",}",
        "{\"acmd\":\"stop\",}",
        "{\"a\":\"stop\",}",
        "{\"cmd\":[\"stop\"],}",
        "{\"cmd\":\"why\",\"a\":\"stop\",}",
        "{\"reason\":\"{\\\"cmd\\\":\\\"stop\\\"}\",}",
        "\"cmd\"",
        "\"cmd\":",
        "stop",
    };
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        refused(IWN_BAD_JSON, lines[i]);
        TEST_ASSERT_NULL_MESSAGE(strstr(refusal.message, "stop is executed"), lines[i]);
        TEST_ASSERT_FALSE_MESSAGE(iwn_cmd_stops(request.cmd), lines[i]);
    }
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"why\",\"a\":{\"cmd\":\"stop\"}}"); // Valid JSON is not searched.
    refused(IWN_MISSING_FIELD, "{\"a\":{\"cmd\":\"stop\"}}");
    accepted("{\"cmd\":\"stop\",\"a\":{\"cmd\":\"estop\"}}", IWN_CMD_STOP);
    TEST_ASSERT_EQUAL_INT(IWN_OK, request.refused);
}

/// The bytes behind the line are not part of it.
TEST(test_request_stop_behind_the_end_of_the_line_stops_nothing) {
    static const char line[] = "{\"cmd\":\"stop\",}";
    for (size_t length = 0; length < 13U; length++) {
        TEST_ASSERT_FALSE(iwn_request_read(line, length, &work, &request, &refusal));
    }
    assert_executed(IWN_CMD_STOP, line, 13U);
}

TEST(test_stop_never_refused_in_a_line_that_is_too_long) {
    char line[IWN_LINE_MAX + 1U];
    memset(line, ' ', sizeof line);
    memcpy(&line[sizeof line - 14U], "{\"cmd\":\"stop\"", 14);
    TEST_ASSERT_TRUE(iwn_request_read(line, sizeof line, NULL, &request, &refusal));
    TEST_ASSERT_EQUAL_INT(IWN_CMD_STOP, request.cmd);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_TOO_LONG, request.refused);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_TOO_LONG, refusal.error);
    TEST_ASSERT_EQUAL_STRING("a request has at most 4096 bytes; end each with a newline; its stop is executed",
                             refusal.message);
}

TEST(test_request_nesting_beyond_the_limit_is_bad_json) {
    char line[IWN_LINE_MAX];
    size_t length = (size_t)snprintf(line, sizeof line, "{\"cmd\":\"arm\",\"name\":");
    memset(&line[length], '[', 3000);
    TEST_ASSERT_FALSE(iwn_request_read(line, length + 3000U, &work, &request, &refusal));
    TEST_ASSERT_EQUAL_INT(IWN_BAD_JSON, refusal.error);
    TEST_ASSERT_NOT_NULL(strstr(refusal.message, "nested more than 8 deep"));
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"name\":[[[[[[[]]]]]]]}");
    refused(IWN_BAD_JSON, "{\"cmd\":\"arm\",\"name\":[[[[[[[[]]]]]]]]}");
    accepted("{\"cmd\":\"arm\",\"name\":\"\\\"[[[[[[[[[[[[{{{{{{\"}", IWN_CMD_ARM);
}

TEST(test_request_line_of_4096_bytes_is_the_longest) {
    char line[IWN_LINE_MAX + 1U];
    memset(line, ' ', sizeof line);
    memcpy(line, "{\"cmd\":\"why\"}", 13);
    TEST_ASSERT_TRUE(iwn_request_read(line, IWN_LINE_MAX, &work, &request, &refusal));
    TEST_ASSERT_FALSE(iwn_request_read(line, IWN_LINE_MAX + 1U, &work, &request, &refusal));
    TEST_ASSERT_EQUAL_INT(IWN_LINE_TOO_LONG, refusal.error);
}

TEST(test_request_with_the_most_values_has_a_defined_refusal) {
    static const char *const units[] = {"{},", "[],", "\"\",", "1,", "1.5,", "{\"a\":1},", "[1],", "\"\\u20ac\","};
    char line[IWN_LINE_MAX];
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++) {
        size_t length = (size_t)snprintf(line, sizeof line, "{\"cmd\":\"watch\",\"topics\":[");
        while (length + strlen(units[i]) + 4U < sizeof line) {
            memcpy(&line[length], units[i], strlen(units[i]));
            length += strlen(units[i]);
        }
        length += (size_t)snprintf(&line[length], sizeof line - length, "1]}");
        TEST_ASSERT_FALSE(iwn_request_read(line, length, &work, &request, &refusal));
        TEST_ASSERT_EQUAL_STRING_MESSAGE("bad_value", iwn_error_name(refusal.error), units[i]);
    }
    char keys[IWN_LINE_MAX];
    size_t length = (size_t)snprintf(keys, sizeof keys, "{\"cmd\":\"why\"");
    for (unsigned key = 0; length + 16U < sizeof keys; key++) {
        length += (size_t)snprintf(&keys[length], sizeof keys - length, ",\"%x\":{}", key);
    }
    length += (size_t)snprintf(&keys[length], sizeof keys - length, "}");
    TEST_ASSERT_FALSE(iwn_request_read(keys, length, &work, &request, &refusal));
    TEST_ASSERT_EQUAL_STRING("unknown_field", iwn_error_name(refusal.error));
}

TEST(test_request_integer_of_another_type_is_a_bad_value) {
    static const char *const values[] = {"1.5", "1.0", "1e2", "true", "false", "null", "\"1\"", "[]", "{}"};
    char line[128];
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
        (void)snprintf(line, sizeof line, "{\"cmd\":\"drive\",\"left_mm_s\":100,\"right_mm_s\":%s}", values[i]);
        refused(IWN_BAD_VALUE, line);
        TEST_ASSERT_NOT_NULL(strstr(refusal.message, "right_mm_s"));
        (void)snprintf(line, sizeof line, "{\"cmd\":\"watch\",\"topics\":[],\"rate_hz\":%s}", values[i]);
        refused(IWN_BAD_VALUE, line);
    }
}

TEST(test_request_missing_field_is_named) {
    refused(IWN_MISSING_FIELD, "{}");
    refused(IWN_MISSING_FIELD, "{\"id\":1}");
    refused(IWN_MISSING_FIELD, "{\"cmd\":\"drive\",\"left_mm_s\":1}");
    TEST_ASSERT_NOT_NULL(strstr(refusal.message, "right_mm_s"));
    refused(IWN_MISSING_FIELD, "{\"cmd\":\"twist\",\"v_mm_s\":1}");
    refused(IWN_MISSING_FIELD, "{\"cmd\":\"watch\"}");
    refused(IWN_MISSING_FIELD, "{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1,\"left_mA\":5}");
    refused(IWN_MISSING_FIELD, "{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1,\"right_mA\":5}");
}

/// The refusal of the line has this error and this text.
static void refused_with(iwn_error_t error, const char *words, const char *line) {
    refused(error, line);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(refusal.message, words), refusal.message);
}

TEST(test_request_first_fault_in_the_line_is_named) {
    refused_with(IWN_UNKNOWN_FIELD, "\"zz\"", "{\"cmd\":\"drive\",\"zz\":1,\"mm\":2,\"aa\":3}");
    refused_with(IWN_UNKNOWN_FIELD, "\"aa\"", "{\"cmd\":\"drive\",\"aa\":1,\"mm\":2,\"zz\":3}");
    refused_with(IWN_BAD_VALUE, "right_mm_s must", "{\"right_mm_s\":\"\",\"left_mm_s\":[],\"cmd\":\"drive\"}");
    refused_with(IWN_BAD_VALUE, "left_mm_s must", "{\"left_mm_s\":[],\"right_mm_s\":\"\",\"cmd\":\"drive\"}");
    refused_with(IWN_UNKNOWN_FIELD, "\"zz\"", "{\"zz\":1,\"left_mm_s\":null,\"cmd\":\"drive\"}");
    refused_with(IWN_BAD_VALUE, "left_mm_s must", "{\"left_mm_s\":null,\"zz\":1,\"cmd\":\"drive\"}");
    refused_with(IWN_UNKNOWN_FIELD, "\"aa\"", "{\"aa\":1,\"left_mm_s\":null,\"cmd\":\"drive\"}");
    refused_with(IWN_BAD_VALUE, "left_mm_s must", "{\"left_mm_s\":null,\"aa\":1,\"cmd\":\"drive\"}");
    refused_with(IWN_BAD_VALUE, "id must", "{\"aa\":1,\"cmd\":\"fly\",\"id\":null}");
    refused_with(IWN_UNKNOWN_CMD, "cmd must", "{\"aa\":1,\"cmd\":\"fly\"}");
    refused_with(IWN_BAD_JSON, "end of file", "{\"aa\":1,\"cmd\":\"fly\",\"id\":null} 7");
    refused_with(IWN_UNKNOWN_FIELD, "\"aa\"", "{\"aa\":1,\"cmd\":\"drive\"}");
}

TEST(test_request_field_of_another_command_is_unknown) {
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"reset\",\"left_mm_s\":1}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1,\"v_mm_s\":1}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"hello\",\"name\":\"x\"}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"reset\",\"\":1}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"reset\",\"Id\":1}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"reset\",\"\xE2\x82\xAC\":1}");
}

TEST(test_request_command_must_be_a_known_text) {
    refused(IWN_UNKNOWN_CMD, "{\"cmd\":\"\"}");
    refused(IWN_UNKNOWN_CMD, "{\"cmd\":\"Stop\"}");
    refused(IWN_UNKNOWN_CMD, "{\"cmd\":\"stop \"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":7}");
    refused(IWN_BAD_VALUE, "{\"cmd\":null}");
}

TEST(test_request_watch_topics_become_bits_unknown_is_refused) {
    accepted("{\"cmd\":\"watch\",\"topics\":[\"state\",\"frame\",\"state\"],\"rate_hz\":25}", IWN_CMD_WATCH);
    TEST_ASSERT_EQUAL_HEX8((1U << IWN_TOPIC_STATE) | (1U << IWN_TOPIC_FRAME), request.topics);
    TEST_ASSERT_EQUAL_INT64(25, request.rate_hz);
    accepted("{\"cmd\":\"watch\",\"topics\":[\"state\",\"bus\",\"estop\",\"lease\",\"stop\",\"force\",\"frame\"]}",
             IWN_CMD_WATCH);
    TEST_ASSERT_EQUAL_HEX8(0x7F, request.topics);
    TEST_ASSERT_EQUAL_INT64(IWN_RATE_DEFAULT_HZ, request.rate_hz);
    refused(IWN_BAD_VALUE, "{\"cmd\":\"watch\",\"topics\":[\"state\",\"weather\"]}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"watch\",\"topics\":[\"state\",1]}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"watch\",\"topics\":\"state\"}");
    refused(IWN_OUT_OF_RANGE, "{\"cmd\":\"watch\",\"topics\":[],\"rate_hz\":0}");
    refused(IWN_OUT_OF_RANGE, "{\"cmd\":\"watch\",\"topics\":[],\"rate_hz\":-1}");
}

TEST(test_request_texts_have_a_length_and_no_control_characters) {
    char line[512];
    char text[IWN_REASON_MAX + 2U];
    memset(text, 'x', sizeof text);
    text[IWN_NAME_MAX] = '\0';
    (void)snprintf(line, sizeof line, "{\"cmd\":\"arm\",\"name\":\"%s\",\"takeover\":true}", text);
    accepted(line, IWN_CMD_ARM);
    TEST_ASSERT_EQUAL_STRING(text, request.name);
    TEST_ASSERT_TRUE(request.takeover);
    (void)snprintf(line, sizeof line, "{\"cmd\":\"arm\",\"name\":\"%sx\"}", text);
    refused(IWN_BAD_VALUE, line);
    text[IWN_NAME_MAX] = 'x';
    text[IWN_REASON_MAX] = '\0';
    (void)snprintf(line, sizeof line, "{\"cmd\":\"estop\",\"reason\":\"%s\"}", text);
    accepted(line, IWN_CMD_ESTOP);
    TEST_ASSERT_EQUAL_STRING(text, request.reason);
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"name\":\"\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"name\":\"a\\u001bb\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"name\":\"a\\u007f\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"name\":5}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"takeover\":1}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"takeover\":null}");
}

TEST(test_request_texts_with_terminal_controls_are_refused) {
    static const char *const forms[] = {
        "{\"cmd\":\"arm\",\"name\":\"a%sb\"}",
        "{\"cmd\":\"status\",\"id\":\"a%sb\"}",
        "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"value\":\"a%sb\"}",
    };
    static const char *const moving[] = {
        "\\u0001",  "\\u001b",      "\\u007f",  "\x7f",         "\\u0080",  "\xC2\x80",     "\\u009b",
        "\xC2\x9B", "\\u009f",      "\xC2\x9F", "\\u061c",      "\xD8\x9C", "\\u200e",      "\xE2\x80\x8F",
        "\\u2028",  "\xE2\x80\xA9", "\\u202a",  "\xE2\x80\xAE", "\\u2066",  "\xE2\x81\xA9",
    };
    static const char *const plain[] = {"\xC2\xA0", "\\u00e9", "\xE2\x82\xAC", "\\u202f", "\\ud83d\\uded1"};
    char line[128];
    for (size_t form = 0; form < sizeof forms / sizeof forms[0]; form++) {
        for (size_t i = 0; i < sizeof moving / sizeof moving[0]; i++) {
            (void)snprintf(line, sizeof line, forms[form], moving[i]);
            refused(IWN_BAD_VALUE, line);
            TEST_ASSERT_NOT_NULL_MESSAGE(strstr(refusal.message, "move a terminal"), refusal.message);
        }
        for (size_t i = 0; i < sizeof plain / sizeof plain[0]; i++) {
            (void)snprintf(line, sizeof line, forms[form], plain[i]);
            TEST_ASSERT_TRUE_MESSAGE(iwn_request_read(line, strlen(line), &work, &request, &refusal), line);
        }
    }
}

/// The estop is accepted, whatever its reason is.
static void latches(const char *reason, const char *value) {
    char line[512];
    (void)snprintf(line, sizeof line, "{\"cmd\":\"estop\",\"reason\":%s}", value);
    accepted(line, IWN_CMD_ESTOP);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(reason, request.reason, line);
    TEST_ASSERT_TRUE(request.sides == IW_SIDES_BOTH && !request.has_t_us && !request.has_stop && !request.takeover);
}

TEST(test_stop_never_refused_for_an_unknown_field) {
    static const char *const fields[] = {
        "\"t_us\":1",     "\"key\":\"x\"",    "\"stop\":1", "\"name\":null", "\"\":[{}]",          "\"reasons\":\"a\"",
        "\"id\":[\"a\"]", "\"id\":\"a\\nb\"", "\"id\":1.5", "\"rate_hz\":0", "\"\xE2\x82\xAC\":1",
    };
    static const iwn_cmd_t cmds[] = {IWN_CMD_STOP, IWN_CMD_DISARM, IWN_CMD_ESTOP};
    static const char *const names[] = {"stop", "disarm", "estop"};
    char line[128];
    for (size_t i = 0; i < 3U * (sizeof fields / sizeof fields[0]); i++) {
        (void)snprintf(line, sizeof line, "{%s,\"cmd\":\"%s\"}", fields[i / 3U], names[i % 3U]);
        accepted(line, cmds[i % 3U]);
        TEST_ASSERT_EQUAL_INT(IWN_ID_NONE, request.id.kind);
        TEST_ASSERT_EQUAL_STRING("", request.reason);
        TEST_ASSERT_FALSE(request.has_t_us || request.has_stop);
    }
    accepted("{\"cmd\":\"stop\",\"reason\":\"a\",\"id\":7}", IWN_CMD_STOP);
    TEST_ASSERT_EQUAL_INT64(7, request.id.number);
    TEST_ASSERT_EQUAL_STRING("", request.reason);
    accepted("{\"aa\":1,\"cmd\":\"estop\",\"reason\":\"a\",\"zz\":2}", IWN_CMD_ESTOP);
    TEST_ASSERT_EQUAL_STRING("a", request.reason);
}

TEST(test_stop_never_refused_for_its_reason) {
    char value[IWN_REASON_MAX + 20U];
    char cut[IWN_REASON_MAX + 1U];
    memset(value, 'x', sizeof value);
    memset(cut, 'x', sizeof cut);
    value[0] = '"';
    memcpy(&value[IWN_REASON_MAX + 2U], "\"", 2U); // 201 characters.
    cut[IWN_REASON_MAX] = '\0';
    latches(cut, value);
    memcpy(&value[IWN_REASON_MAX - 1U], "\xE2\x82\xAC\"", 5U); // 198 and one of three bytes, of which two fit.
    cut[IWN_REASON_MAX - 2U] = cut[IWN_REASON_MAX - 1U] = ' ';
    latches(cut, value);
    memcpy(&value[IWN_REASON_MAX - 1U], "\\u20ac\"", 8U); // A character with an escape is complete or left out.
    cut[IWN_REASON_MAX - 2U] = '\0';
    latches(cut, value);
    latches("Traceback:  line", "\"Traceback:\\n\\tline\"");
    latches("stop   ", "\"stop\\u200e\"");
    latches("stop   now", "\"stop\xE2\x80\xA8now\"");
    latches("", "\"\"");
    latches("", "7");
    latches("", "null");
    latches("", "[\"a\",{\"reason\":\"b\"}]");
}

TEST(test_request_record_is_on_or_off) {
    accepted("{\"cmd\":\"record\",\"on\":true}", IWN_CMD_RECORD);
    TEST_ASSERT_TRUE(request.on);
    accepted("{\"cmd\":\"record\",\"on\":false}", IWN_CMD_RECORD);
    TEST_ASSERT_FALSE(request.on);
    refused(IWN_MISSING_FIELD, "{\"cmd\":\"record\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"record\",\"on\":1}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"record\",\"on\":true,\"name\":\"x\"}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"recordings\",\"on\":true}");
}

TEST(test_request_config_reads_stages_or_commits) {
    accepted("{\"cmd\":\"config\"}", IWN_CMD_CONFIG);
    TEST_ASSERT_EQUAL_STRING("", request.key);
    TEST_ASSERT_FALSE(request.has_commit);
    accepted("{\"cmd\":\"config\",\"key\":\"drive.lease_ms\",\"value\":300}", IWN_CMD_CONFIG);
    TEST_ASSERT_EQUAL_STRING("drive.lease_ms", request.key);
    TEST_ASSERT_EQUAL_STRING("300", request.value);
    accepted("{\"cmd\":\"config\",\"commit\":false}", IWN_CMD_CONFIG);
    TEST_ASSERT_TRUE(request.has_commit && !request.commit);
    accepted("{\"cmd\":\"config\",\"commit\":true}", IWN_CMD_CONFIG);
    TEST_ASSERT_TRUE(request.has_commit && request.commit);
    refused(IWN_BAD_VALUE, "{\"cmd\":\"config\",\"key\":\"\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"config\",\"key\":\"12345678901234567890123456789012345678901\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"config\",\"commit\":1}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"config\",\"item\":\"track\"}");
}

TEST(test_request_time_and_stop_are_read_exactly) {
    accepted("{\"cmd\":\"arm\",\"t_us\":9223372036854775807}", IWN_CMD_ARM);
    TEST_ASSERT_TRUE(request.has_t_us);
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, request.t_us);
    accepted("{\"cmd\":\"reset\",\"stop\":-1,\"t_us\":0}", IWN_CMD_RESET);
    TEST_ASSERT_TRUE(request.has_t_us && request.has_stop);
    TEST_ASSERT_EQUAL_INT64(0, request.t_us);
    TEST_ASSERT_EQUAL_INT64(-1, request.stop);
    accepted("{\"cmd\":\"confirm\",\"item\":\"dlc\",\"t_us\":5}", IWN_CMD_CONFIRM);
    TEST_ASSERT_TRUE(request.has_t_us && !request.has_stop);
    accepted("{\"cmd\":\"reset\"}", IWN_CMD_RESET);
    TEST_ASSERT_FALSE(request.has_t_us || request.has_stop);
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"t_us\":1.0}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"t_us\":\"1\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"arm\",\"t_us\":null}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"reset\",\"stop\":\"7\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"reset\",\"stop\":7.5}");
    refused(IWN_BAD_JSON, "{\"cmd\":\"arm\",\"t_us\":9223372036854775808}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"arm\",\"stop\":7}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"tare\",\"t_us\":7}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1,\"t_us\":7}");
}

TEST(test_request_drive_accepts_a_key_of_at_most_32_bytes) {
    accepted("{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1,\"key\":\"0123456789abcdef0123456789abcdef\"}",
             IWN_CMD_DRIVE);
    TEST_ASSERT_EQUAL_STRING("0123456789abcdef0123456789abcdef", request.lease_key);
    accepted("{\"cmd\":\"twist\",\"v_mm_s\":1,\"yaw_mrad_s\":1,\"key\":\"0\"}", IWN_CMD_TWIST);
    TEST_ASSERT_EQUAL_STRING("0", request.lease_key);
    accepted("{\"cmd\":\"twist\",\"v_mm_s\":1,\"yaw_mrad_s\":1}", IWN_CMD_TWIST);
    TEST_ASSERT_EQUAL_STRING("", request.lease_key);
    refused(IWN_BAD_VALUE,
            "{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1,\"key\":\"0123456789abcdef0123456789abcdef0\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1,\"key\":\"\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1,\"key\":7}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"arm\",\"key\":\"0\"}");
    refused(IWN_UNKNOWN_FIELD, "{\"cmd\":\"reset\",\"key\":\"0\"}");
}

TEST(test_request_tare_accepts_a_side_or_none) {
    accepted("{\"cmd\":\"tare\"}", IWN_CMD_TARE);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_BOTH, request.sides);
    accepted("{\"cmd\":\"tare\",\"side\":\"left\"}", IWN_CMD_TARE);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_LEFT, request.sides);
    accepted("{\"cmd\":\"tare\",\"side\":\"right\"}", IWN_CMD_TARE);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_RIGHT, request.sides);
    refused(IWN_BAD_VALUE, "{\"cmd\":\"tare\",\"side\":\"both\"}");
    refused(IWN_BAD_VALUE, "{\"cmd\":\"tare\",\"side\":3}");
}
