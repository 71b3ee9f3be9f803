// SPDX-License-Identifier: MIT
// Which MQTT commands are accepted, by their age on the clock of this machine and by the count of their sender, and
// which events the bridge publishes about them.
#include "mqtt_command.h"
#include "mqtt_contents.h"

#include "folder.h"
#include "unit.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NOW_US 50000000U
#define BOOT   "0123456789abcdef"

static mqtt_judge_t judge;
static mqtt_rules_t rules;
static mqtt_order_t order;

void setUp(void) {
    memset(&judge, 0, sizeof judge);
    rules = (mqtt_rules_t){BOOT, 300, true, true, "iwheel/w1/reply/", 0};
}

static mqtt_verdict_t judge_text(const char *verb, const char *text, uint64_t now_us) {
    const mqtt_command_t command = {.verb = verb, .payload = text, .length = strlen(text)};
    const uint64_t before = judge.counts[MQTT_TAKEN];
    mqtt_judge(&judge, &rules, &command, now_us, &order);
    TEST_ASSERT_EQUAL(order.verdict == MQTT_TAKEN, judge.counts[MQTT_TAKEN] == before + 1U);
    TEST_ASSERT_EQUAL(order.verdict == MQTT_TAKEN, order.request[0] != '\0');
    TEST_ASSERT_EQUAL(order.verdict == MQTT_TAKEN, order.why[0] == '\0');
    return order.verdict;
}

/// Judges a command of `far` with these additional fields.
static mqtt_verdict_t judge_it(const char *verb, uint64_t stamp_us, int seq, const char *fields, uint64_t now_us) {
    char text[512];
    (void)snprintf(text, sizeof text, "{\"from\":\"far\",\"boot\":\"" BOOT "\",\"t_us\":%llu,\"seq\":%d%s}",
                   (unsigned long long)stamp_us, seq, fields);
    return judge_text(verb, text, now_us);
}

/// The command of `far` is accepted now and becomes this request.
static void assert_request(const char *verb, int seq, const char *fields, const char *request) {
    TEST_ASSERT_EQUAL_MESSAGE(MQTT_TAKEN, judge_it(verb, NOW_US, seq, fields, NOW_US), verb);
    TEST_ASSERT_EQUAL_STRING(request, order.request);
}

TEST(test_command_fresh_becomes_the_request_of_the_gateway) {
    assert_request("stop", 1, "", "{\"cmd\":\"stop\"}");
    assert_request("estop", 2, ",\"reason\":\"a \\\"b\\\"\"", "{\"cmd\":\"estop\",\"reason\":\"a \\\"b\\\"\"}");
    assert_request("drive", 3, ",\"left_mm_s\":-5,\"right_mm_s\":7",
                   "{\"cmd\":\"drive\",\"left_mm_s\":-5,\"right_mm_s\":7}");
    assert_request("arm", 4, "", "{\"cmd\":\"arm\",\"name\":\"mqtt far\",\"t_us\":50000000}");
}

TEST(test_command_age_is_judged_to_the_microsecond) {
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("stop", NOW_US, 1, "", NOW_US + 1000000U));
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("stop", NOW_US, 2, "", NOW_US + 1000001U));
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("estop", NOW_US, 3, "", NOW_US + 1000001U));
    TEST_ASSERT_EQUAL(MQTT_EARLY, judge_it("stop", NOW_US + 1U, 4, "", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("drive", NOW_US, 5, "", NOW_US + 300000U));
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("drive", NOW_US, 6, "", NOW_US + 300001U));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("stop", NOW_US, 7, ",\"ttl_ms\":100", NOW_US + 100000U));
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("stop", NOW_US, 8, ",\"ttl_ms\":100", NOW_US + 100001U));
    rules.ahead_us = -3600; // A board has a clock of its own.
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("stop", NOW_US, 9, "", NOW_US + 1003600U));
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("stop", NOW_US, 10, "", NOW_US + 1003601U));
    TEST_ASSERT_EQUAL(MQTT_EARLY, judge_it("stop", NOW_US, 11, "", NOW_US + 3599U));
}

/// Judges a command with properties of MQTT 5.
static mqtt_verdict_t judge_labelled(const char *verb, int seq, const char *answer_to, size_t correlation_length) {
    static const char correlation[MQTT_CORRELATION_MAX + 1U] = "c\0d";
    char text[128];
    (void)snprintf(text, sizeof text, "{\"from\":\"far\",\"boot\":\"" BOOT "\",\"t_us\":%u,\"seq\":%d}", NOW_US, seq);
    const mqtt_command_t command = {.verb = verb,
                                    .payload = text,
                                    .length = strlen(text),
                                    .answer_to = answer_to,
                                    .correlation = correlation,
                                    .correlation_length = correlation_length};
    mqtt_judge(&judge, &rules, &command, NOW_US, &order);
    return order.verdict;
}

TEST(test_command_response_topic_must_be_a_reply_of_this_machine) {
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_labelled("why", 1, NULL, 0));
    TEST_ASSERT_EQUAL_STRING("far", order.to);
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_labelled("why", 2, "iwheel/w1/reply/other", 0));
    TEST_ASSERT_EQUAL_STRING("other", order.to);
    static const char *const wrong[] = {"iwheel/w1/event/stop", "iwheel/w2/reply/far", "iwheel/w1/reply/",
                                        "iwheel/w1/reply/a/b",  "iwheel/w1/reply/#",   ""};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(MQTT_GARBLED, judge_labelled("why", 3, wrong[i], 0), wrong[i]);
        TEST_ASSERT_EQUAL_STRING("far", order.to);
        TEST_ASSERT_EQUAL_STRING("", order.request);
    }
}

TEST(test_refusal_is_sent_where_the_command_requests_it) {
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_labelled("why", 0, "iwheel/w1/reply/other", 3));
    TEST_ASSERT_NOT_NULL(strstr(order.why, "seq"));
    TEST_ASSERT_EQUAL_STRING("other", order.to);
    TEST_ASSERT_EQUAL_UINT16(3, order.correlation_length);
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_labelled("unknown", 1, "iwheel/w1/reply/other", 0));
    TEST_ASSERT_NOT_NULL(strstr(order.why, "no such command"));
    TEST_ASSERT_EQUAL_STRING("other", order.to);
}

TEST(test_command_correlation_data_is_stored_up_to_its_limit) {
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_labelled("why", 1, NULL, 3));
    TEST_ASSERT_EQUAL_UINT16(3, order.correlation_length);
    TEST_ASSERT_EQUAL_MEMORY("c\0d", order.correlation, 3);
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_labelled("why", 2, NULL, MQTT_CORRELATION_MAX));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_labelled("why", 3, NULL, MQTT_CORRELATION_MAX + 1U));
}

TEST(test_command_ttl_cannot_extend_its_age_limit) {
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("drive", NOW_US, 1, ",\"ttl_ms\":1000", NOW_US + 300001U));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("why", NOW_US, 2, ",\"ttl_ms\":1001", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("why", NOW_US, 3, ",\"ttl_ms\":0", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("stop", NOW_US, 4, ",\"ttl_ms\":0", NOW_US + 1000000U));
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("stop", NOW_US, 5, ",\"ttl_ms\":1001", NOW_US + 1000001U));
}

TEST(test_command_of_another_boot_is_dropped_before_its_age) {
    const char *text = "{\"from\":\"far\",\"boot\":\"0123456789abcdee\",\"t_us\":50000000,\"seq\":1}";
    TEST_ASSERT_EQUAL(MQTT_OTHER_BOOT, judge_text("stop", text, NOW_US));
}

TEST(test_command_seq_must_increase) {
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("why", NOW_US, 5, "", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_DOUBLED, judge_it("why", NOW_US, 5, "", NOW_US + 1U));
    TEST_ASSERT_EQUAL(MQTT_DOUBLED, judge_it("why", NOW_US, 4, "", NOW_US + 1000000U));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("why", NOW_US, 6, "", NOW_US + 1000000U));
}

/// A client that sends under another name can use up the numbers of that name, or all places. Neither refuses a stop.
TEST(test_stop_never_needs_a_seq_that_rises_or_a_place) {
    char text[256];
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("why", NOW_US, 1000, "", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("stop", NOW_US, 5, "", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("stop", NOW_US, 5, "", NOW_US));
    for (unsigned i = 0; i <= MQTT_SENDERS; i++) {
        (void)snprintf(text, sizeof text, "{\"from\":\"s%u\",\"boot\":\"" BOOT "\",\"t_us\":50000000,\"seq\":9}", i);
        (void)judge_text("why", text, NOW_US);
    }
    TEST_ASSERT_EQUAL(MQTT_CROWDED, order.verdict);
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_text("estop", text, NOW_US));
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_text("stop", text, NOW_US + 1000001U));
}

TEST(test_command_reset_needs_its_stop_and_the_drive_age_limit) {
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("reset", NOW_US, 1, "", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("reset", NOW_US, 1, ",\"stop\":\"4\"", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("reset", NOW_US, 2, ",\"stop\":4", NOW_US + 300000U));
    TEST_ASSERT_EQUAL_STRING("{\"cmd\":\"reset\",\"stop\":4,\"t_us\":50000000}", order.request);
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("reset", NOW_US, 3, ",\"stop\":4", NOW_US + 300001U));
}

TEST(test_command_key_is_separate_and_a_late_drive_reports_motion) {
    assert_request("drive", 1, ",\"left_mm_s\":0,\"key\":\"abc\"", "{\"cmd\":\"drive\",\"left_mm_s\":0}");
    TEST_ASSERT_EQUAL_STRING("abc", order.key);
    TEST_ASSERT_FALSE(order.moves);
    TEST_ASSERT_EQUAL(MQTT_LATE, judge_it("drive", NOW_US, 2, ",\"left_mm_s\":-1", NOW_US + 900000U));
    TEST_ASSERT_TRUE_MESSAGE(order.moves, "dropped, and yet a stick that is held");
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("twist", NOW_US, 3, ",\"v_mm_s\":0,\"key\":7", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("arm", NOW_US, 4, ",\"key\":\"abc\"", NOW_US));
    assert_request("arm", 5, ",\"takeover\":true",
                   "{\"cmd\":\"arm\",\"takeover\":true,\"name\":\"mqtt far\",\"t_us\":50000000}");
}

TEST(test_command_seq_may_restart_only_after_all_earlier_are_late) {
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("why", NOW_US, 500, "", NOW_US));
    for (uint64_t later_us = 0; later_us <= 3000000U; later_us += 1000U) {
        TEST_ASSERT_NOT_EQUAL(MQTT_TAKEN, judge_it("why", NOW_US, 500, "", NOW_US + later_us));
    }
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("why", NOW_US + 1000001U, 1, "", NOW_US + 1000001U));
}

TEST(test_command_of_one_sender_too_many_is_dropped) {
    char text[256];
    for (unsigned i = 0; i <= MQTT_SENDERS; i++) {
        (void)snprintf(text, sizeof text, "{\"from\":\"s%u\",\"boot\":\"" BOOT "\",\"t_us\":50000000,\"seq\":9}", i);
        TEST_ASSERT_EQUAL((i < MQTT_SENDERS) ? MQTT_TAKEN : MQTT_CROWDED, judge_text("why", text, NOW_US));
    }
    (void)snprintf(text, sizeof text, "{\"from\":\"s0\",\"boot\":\"" BOOT "\",\"t_us\":50000000,\"seq\":9}");
    TEST_ASSERT_EQUAL(MQTT_DOUBLED, judge_text("why", text, NOW_US));
    (void)snprintf(text, sizeof text, "{\"from\":\"new\",\"boot\":\"" BOOT "\",\"t_us\":51000001,\"seq\":1}");
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_text("why", text, NOW_US + 1000001U));
}

TEST(test_command_retained_is_dropped_including_hello) {
    const char *text = "{\"from\":\"far\",\"boot\":\"" BOOT "\",\"t_us\":50000000,\"seq\":1}";
    static const char *const verbs[] = {"stop", "estop", "hello", "drive"};
    for (size_t i = 0; i < 4U; i++) {
        const mqtt_command_t command = {.verb = verbs[i], .payload = text, .length = strlen(text), .retained = true};
        mqtt_judge(&judge, &rules, &command, NOW_US, &order);
        TEST_ASSERT_EQUAL(MQTT_RETAINED, order.verdict);
    }
    TEST_ASSERT_EQUAL_UINT64(4, judge.counts[MQTT_RETAINED]);
}

TEST(test_command_hello_without_a_time_is_accepted) {
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_text("hello", "{\"from\":\"far\",\"seq\":1}", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_text("stop", "{\"from\":\"far\",\"seq\":2}", NOW_US));
}

TEST(test_command_that_drives_needs_the_right_and_stop_does_not) {
    static const char *const verbs[] = {"arm", "drive", "twist", "reset"};
    rules.may_drive = false;
    rules.may_reset = false;
    for (int i = 0; i < 4; i++) {
        const char *more = (i == 3) ? ",\"stop\":1" : "";
        TEST_ASSERT_EQUAL(MQTT_DENIED, judge_it(verbs[i], NOW_US, i + 1, more, NOW_US));
    }
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("stop", NOW_US, 10, "", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("estop", NOW_US, 11, "", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_it("why", NOW_US, 12, "", NOW_US));
}

TEST(test_command_garbled_is_dropped) {
    static const char *const texts[] = {
        "",
        "x",
        "[]",
        "{\"from\":\"far\"}",
        "{\"from\":7,\"seq\":1}",
        "{\"from\":\"\",\"seq\":1}",
        "{\"from\":\"a/b\",\"seq\":1}",
        "{\"from\":\"a+\",\"seq\":1}",
        "{\"from\":\"far\",\"seq\":1.0}",
        "{\"from\":\"far\",\"seq\":-1}",
        "{\"from\":\"far\",\"seq\":1,\"seq\":2}",
        "{\"from\":\"far\",\"seq\":1,\"boot\":\"" BOOT "\",\"t_us\":\"1\"}",
        "{\"from\":\"far\",\"seq\":1,\"boot\":\"" BOOT "0\",\"t_us\":1}",
        "{\"from\":\"far\",\"seq\":1,\"boot\":\"" BOOT "\",\"t_us\":-1}",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(MQTT_GARBLED, judge_text("why", texts[i], NOW_US), texts[i]);
    }
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("takeover", NOW_US, 1, "", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("drive", NOW_US, 1, ",\"left_mm_s\":{\"cmd\":\"arm\"}", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("drive", NOW_US, 1, ",\"left_mm_s\":true", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("drive", NOW_US, 1, ",\"takeover\":true", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("reset", NOW_US, 1, ",\"stop\":1,\"left_mm_s\":1", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_it("why", NOW_US, 1, ",\"reason\":\"a\"", NOW_US));
}

/// The estop with this value as its reason becomes this request.
static void expect_estop(const char *request, const char *value) {
    static char text[6000];
    (void)snprintf(text, sizeof text,
                   "{\"from\":\"far\",\"boot\":\"" BOOT "\",\"t_us\":50000000,\"seq\":1,\"reason\":%s}", value);
    TEST_ASSERT_EQUAL_MESSAGE(MQTT_TAKEN, judge_text("estop", text, NOW_US), value);
    TEST_ASSERT_EQUAL_STRING(request, order.request);
}

/// The time alone decides: who sent it, its number, its limit and where its answer goes do not.
TEST(test_stop_never_needs_a_sender_a_number_or_a_destination) {
    static const char *const texts[] = {
        "{\"boot\":\"" BOOT "\",\"t_us\":50000000}",
        "{\"boot\":\"" BOOT "\",\"t_us\":50000000,\"from\":\"a/b\",\"seq\":\"1\"}",
        "{\"boot\":\"" BOOT "\",\"t_us\":50000000,\"from\":7,\"seq\":1.0,\"ttl_ms\":\"\"}",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(MQTT_TAKEN, judge_text("stop", texts[i], NOW_US), texts[i]);
        TEST_ASSERT_EQUAL_STRING("{\"cmd\":\"stop\"}", order.request);
        TEST_ASSERT_EQUAL_STRING("", order.to);
        TEST_ASSERT_EQUAL_MESSAGE(MQTT_TAKEN, judge_text("estop", texts[i], NOW_US), texts[i]);
    }
    TEST_ASSERT_EQUAL(MQTT_GARBLED, judge_text("stop", "{\"boot\":\"" BOOT "\",\"t_us\":\"1\"}", NOW_US));
    TEST_ASSERT_EQUAL(MQTT_TAKEN, judge_labelled("stop", 1, "elsewhere", MQTT_CORRELATION_MAX + 1U));
    TEST_ASSERT_EQUAL_STRING("far", order.to);
}

TEST(test_stop_never_refused_by_mqtt_for_a_field_or_its_reason) {
    char value[5003];
    char request[300];
    assert_request("stop", 1, ",\"left_mm_s\":1,\"reason\":[]", "{\"cmd\":\"stop\"}");
    expect_estop("{\"cmd\":\"estop\",\"reason\":\"line one line two\"}", "\"line one\\nline two\"");
    expect_estop("{\"cmd\":\"estop\",\"reason\":\"a   b\"}", "\"a\\u200eb\",\"key\":{\"cmd\":\"arm\"}");
    expect_estop("{\"cmd\":\"estop\"}", "\"\"");
    expect_estop("{\"cmd\":\"estop\"}", "7");
    expect_estop("{\"cmd\":\"estop\"}", "{\"cmd\":\"arm\"}");
    memset(value, 'x', sizeof value);
    value[0] = '"';
    memcpy(&value[5001], "\"", 2U);
    (void)snprintf(request, sizeof request, "{\"cmd\":\"estop\",\"reason\":\"%.200s\"}", &value[1]);
    expect_estop(request, value);
    memcpy(&value[202], "\"", 2U); // 201 characters.
    expect_estop(request, value);
}

/// The payload is dropped as garbled, and this request is sent to the gateway anyway; empty: none.
static void assert_garbled(const char *request, const char *verb, const char *text, bool retained) {
    const mqtt_command_t command = {.verb = verb, .payload = text, .length = strlen(text), .retained = retained};
    mqtt_judge(&judge, &rules, &command, NOW_US, &order);
    TEST_ASSERT_EQUAL_MESSAGE(MQTT_GARBLED, order.verdict, text);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(request, order.request, text);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(
        (request[0] != '\0') ? "not a JSON object; the stop is executed" : "not a JSON object", order.why, text);
    TEST_ASSERT_EQUAL_STRING("", order.to);
}

/// Nothing states its age.
TEST(test_stop_never_refused_by_mqtt_without_a_json_object) {
    static const char *const texts[] = {
        "",
        "stop",
        "[]",
        "{\"boot\":\"" BOOT "\",\"t_us\":50000000",
        "{\"boot\":\"" BOOT "\",\"t_us\":1,\"t_us\":1}",
        "{\"from\":\"far\",\"seq\":1,\"reason\":\"\\ud83d\"}",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        assert_garbled("{\"cmd\":\"stop\"}", "stop", texts[i], false);
        assert_garbled("{\"cmd\":\"estop\"}", "estop", texts[i], false);
        assert_garbled("", "stop", texts[i], true);
        assert_garbled("", "reset", texts[i], false);
    }
    const mqtt_command_t asked = {.verb = "stop", .payload = "{", .length = 1, .answer_to = "iwheel/w1/reply/other"};
    mqtt_judge(&judge, &rules, &asked, NOW_US, &order);
    TEST_ASSERT_EQUAL_STRING("other", order.to);
}

TEST(test_stop_never_refused_by_mqtt_for_its_length) {
    static char text[IWN_JSON_MAX + 1U];
    memset(text, ' ', sizeof text);
    const mqtt_command_t command = {.verb = "estop", .payload = text, .length = sizeof text};
    mqtt_judge(&judge, &rules, &command, NOW_US, &order);
    TEST_ASSERT_EQUAL(MQTT_GARBLED, order.verdict);
    TEST_ASSERT_EQUAL_STRING("{\"cmd\":\"estop\"}", order.request);
}

TEST(test_command_too_long_is_garbled) {
    static char text[MQTT_COMMAND_MAX + 2U];
    memset(text, ' ', sizeof text);
    memcpy(text, "{\"from\":\"far\",\"seq\":1}", 22);
    const mqtt_command_t command = {.verb = "hello", .payload = text, .length = MQTT_COMMAND_MAX};
    const mqtt_command_t longer = {.verb = "hello", .payload = text, .length = MQTT_COMMAND_MAX + 1U};
    mqtt_judge(&judge, &rules, &command, NOW_US, &order);
    TEST_ASSERT_EQUAL(MQTT_TAKEN, order.verdict);
    mqtt_judge(&judge, &rules, &longer, NOW_US, &order);
    TEST_ASSERT_EQUAL(MQTT_GARBLED, order.verdict);
}

// ---- topics and messages ------------------------------------------------------------------------------------------

TEST(test_topics_of_other_machines_are_not_parsed) {
    char topic[MQTT_TOPIC_SIZE];
    mqtt_topic("w1", "event", "stop", topic);
    TEST_ASSERT_EQUAL_STRING("iwheel/w1/event/stop", topic);
    mqtt_topic("w1", "info", NULL, topic);
    TEST_ASSERT_EQUAL_STRING("iwheel/w1/info", topic);
    TEST_ASSERT_EQUAL_STRING("estop", mqtt_topic_verb("w1", "iwheel/w1/cmd/estop"));
    TEST_ASSERT_NULL(mqtt_topic_verb("w1", "iwheel/w10/cmd/stop"));
    TEST_ASSERT_NULL(mqtt_topic_verb("w1", "iwheel/w1/event/stop"));
    TEST_ASSERT_NULL(mqtt_topic_verb("w1", "iwheel/w1/cmd"));
}

TEST(test_messages_of_the_gateway_follow_the_fields_of_the_bridge) {
    char text[256];
    const mqtt_buffer_t buffer = {text, sizeof text};
    const char *line = "{\"event\":\"fault\",\"t_us\":5}";
    const iwc_message_t event = {.text = line, .length = strlen(line), .is_event = true};
    size_t length = mqtt_write_state(BOOT, &event, buffer);
    TEST_ASSERT_EQUAL_STRING_LEN("{\"boot\":\"" BOOT "\",\"event\":\"fault\",\"t_us\":5}", text, length);
    length = mqtt_write_event(BOOT, 7, 99, &event, buffer);
    TEST_ASSERT_EQUAL_STRING_LEN("{\"id\":\"" BOOT "-7\",\"boot\":\"" BOOT
                                 "\",\"heard_wall_us\":99,\"event\":\"fault\",\"t_us\":5}",
                                 text, length);
}

TEST(test_reply_quotes_time_seq_and_reply_of_the_gateway) {
    char text[512];
    const mqtt_buffer_t buffer = {text, sizeof text};
    const char *line = "{\"id\":12,\"ok\":true,\"state\":\"stopping\"}";
    const iwc_message_t reply = {.text = line, .length = strlen(line)};
    (void)judge_it("why", NOW_US, 3, "", NOW_US);
    size_t length = mqtt_write_answer(BOOT, NOW_US, &order, &reply, buffer);
    TEST_ASSERT_EQUAL_STRING_LEN("{\"boot\":\"" BOOT
                                 "\",\"t_us\":50000000,\"cmd\":\"why\",\"seq\":3,\"ok\":true,\"state\":\"stopping\"}",
                                 text, length);
    (void)judge_it("why", NOW_US, 3, "", NOW_US);
    length = mqtt_write_answer(BOOT, NOW_US, &order, NULL, buffer);
    TEST_ASSERT_EQUAL_STRING_LEN("{\"boot\":\"" BOOT
                                 "\",\"t_us\":50000000,\"cmd\":\"why\",\"seq\":3,\"ok\":false,\"error\":\"doubled\","
                                 "\"message\":\"seq must increase with each command of a sender\"}",
                                 text, length);
}

TEST(test_message_that_does_not_fit_is_not_written) {
    char text[64];
    const char *line = "{\"event\":\"fault\",\"t_us\":5}";
    const iwc_message_t event = {.text = line, .length = strlen(line), .is_event = true};
    for (size_t size = 1; size < sizeof text; size++) {
        const size_t length = mqtt_write_state(BOOT, &event, (mqtt_buffer_t){text, size});
        TEST_ASSERT_TRUE(length == 0U || (length <= size && text[length - 1U] == '}'));
    }
    TEST_ASSERT_EQUAL_size_t(0, mqtt_write_event(BOOT, 1, 1, &event, (mqtt_buffer_t){text, sizeof text}));
}

TEST(test_missed_stop_is_published_without_its_frames) {
    char text[1024];
    const char *line = "{\"id\":1,\"ok\":true,\"number\":4,\"cause\":\"wheel_lost\",\"wall_us\":77,\"at_us\":66,"
                       "\"sentence\":\"gone\",\"frames_before\":[1,2,3]}";
    const iwc_message_t why = {.text = line, .length = strlen(line)};
    const size_t length = mqtt_write_missed_stop(BOOT, 2, 99, &why, (mqtt_buffer_t){text, sizeof text});
    text[length] = '\0';
    TEST_ASSERT_NOT_NULL(
        strstr(text, "\"event\":\"stop\",\"missed\":true,\"t_us\":66,\"number\":4,\"cause\":\"wheel_lost\""));
    TEST_ASSERT_NULL(strstr(text, "frames_before"));
    TEST_ASSERT_NOT_NULL(strstr(text, "\"recording\":null}"));
}

TEST(test_info_without_a_gateway_has_no_values_of_it) {
    char text[2048];
    mqtt_settings_t settings;
    const uint64_t counts[MQTT_VERDICTS] = {1, 2};
    settings = mqtt_settings_standard;
    mqtt_stop_t stop = {.number = 0};
    const mqtt_info_t info = {.boot = BOOT, .settings = &settings, .counts = counts, .dropped = 3, .stop = &stop};
    size_t length = mqtt_write_info(&info, (mqtt_buffer_t){text, sizeof text});
    text[length] = '\0';
    TEST_ASSERT_NOT_NULL(strstr(text, "\"last_stop\":null}"));
    TEST_ASSERT_NOT_NULL(strstr(text, "\"gateway\":\"away\",\"version\":null,"));
    TEST_ASSERT_NOT_NULL(strstr(text, "\"budget\":null"));
    TEST_ASSERT_NOT_NULL(strstr(text, "\"taken\":1,\"retained\":2,"));
    TEST_ASSERT_NOT_NULL(strstr(text, "\"dropped\":3,\"last\":0,\"aside\":0,\"on_disk\":false"));
    stop = (mqtt_stop_t){.number = 4, .cause = "wheel_lost", .sentence = "gone"};
    length = mqtt_write_info(&info, (mqtt_buffer_t){text, sizeof text});
    text[length] = '\0';
    TEST_ASSERT_NOT_NULL(
        strstr(text, "\"last_stop\":{\"number\":4,\"cause\":\"wheel_lost\",\"wall_us\":null,\"sentence\":\"gone\"}}"));
}

TEST(test_info_has_the_longest_sentence_of_a_stop) {
    static char text[MQTT_PAYLOAD_SIZE];
    static const uint64_t counts[MQTT_VERDICTS];
    mqtt_stop_t stop = {.number = 4, .cause = "wheel_lost"};
    const mqtt_info_t info = {.boot = BOOT, .settings = &mqtt_settings_standard, .counts = counts, .stop = &stop};
    TEST_ASSERT_EQUAL_size_t(IWN_SENTENCE_SIZE, sizeof stop.sentence);
    memset(stop.sentence, 's', IWN_SENTENCE_SIZE - 1U);
    const size_t length = mqtt_write_info(&info, (mqtt_buffer_t){text, sizeof text});
    text[length] = '\0';
    TEST_ASSERT_NOT_NULL(strstr(text, stop.sentence));
}

// ---- settings -----------------------------------------------------------------------------------------------------

static unsigned errors_of(const char *text) {
    mqtt_settings_t settings;
    FILE *err = fopen("/dev/null", "w");
    settings_report_t report = {.name = "test", .err = err};
    settings = mqtt_settings_standard;
    const int code = settings_parse(&mqtt_settings_form, &report, text, strlen(text), &settings);
    (void)fclose(err);
    TEST_ASSERT_EQUAL(code != 0, report.errors != 0U);
    return report.errors;
}

TEST(test_settings_that_are_unsafe_are_refused) {
    TEST_ASSERT_EQUAL_UINT(0, errors_of("[machine]\nid = w1\n"));
    TEST_ASSERT_EQUAL_UINT(1, errors_of("[broker]\nhost = broker.example\n"));
    TEST_ASSERT_EQUAL_UINT(0, errors_of("[broker]\nhost = broker.example\nca = /x.pem\n"));
    TEST_ASSERT_EQUAL_UINT(0, errors_of("[broker]\nhost = broker.example\nallow_plain = yes\n"));
    TEST_ASSERT_EQUAL_UINT(1, errors_of("[broker]\nca = /x.pem\nkey = /x.key\n"));
    TEST_ASSERT_EQUAL_UINT(1, errors_of("[broker]\ncertificate = /x.pem\nkey = /x.key\n"));
    TEST_ASSERT_EQUAL_UINT(1, errors_of("[drive]\nallow_reset = yes\n"));
    TEST_ASSERT_EQUAL_UINT(1, errors_of("[drive]\nttl_ms = 1001\n"));
    TEST_ASSERT_EQUAL_UINT(1, errors_of("[state]\nevery_ms = 99\n"));
    TEST_ASSERT_EQUAL_UINT(1, errors_of("[machine]\nid = a/b\n"));
    TEST_ASSERT_EQUAL_UINT(1, errors_of("[machine]\nid = #\n"));
}

TEST(test_settings_shipped_are_the_defaults) {
    char *printed = NULL;
    size_t length = 0;
    mqtt_settings_t settings;
    settings = mqtt_settings_standard;
    FILE *out = open_memstream(&printed, &length);
    settings_print(&mqtt_settings_form, &settings, &settings, NULL, out);
    (void)fclose(out);
    TEST_ASSERT_EQUAL_STRING(printed, file_text(IWHEEL_SHARE_DIR "/mqtt.conf"));
    free(printed);
}
