// SPDX-License-Identifier: MIT
// A connection of the northbound socket (bytes in, lines out), the JSON writer, and the sentence of `why`.
#include "clients/client.h"
#include "process/log.h"

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/why.h"

#include "unity.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static gw_client_t client;
static int peer;
static char big[GW_REPLY_MAX];

void setUp(void) {
    int pair[2];
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair));
    memset(&client, 0, sizeof client);
    client.id = 7;
    client.pid = 42;
    client.fd = pair[0];
    peer = pair[1];
    memset(big, 'x', sizeof big);
}

void tearDown(void) {
    (void)close(client.fd);
    (void)close(peer);
}

static void say(const char *text) {
    TEST_ASSERT_EQUAL_INT((int)strlen(text), (int)send(peer, text, strlen(text), MSG_NOSIGNAL));
    gw_client_read(&client);
}

static void expect_line(const char *text) {
    size_t length = 0;
    const char *line = gw_client_line(&client, &length);
    TEST_ASSERT_NOT_NULL(line);
    TEST_ASSERT_EQUAL_UINT(strlen(text), length);
    TEST_ASSERT_EQUAL_INT(0, memcmp(text, line, length));
    gw_client_drop_line(&client, length);
}

static void expect_no_line(void) {
    size_t length = 0;
    TEST_ASSERT_NULL(gw_client_line(&client, &length));
}

/// Everything that the other side can read now.
static size_t drain(char *text, size_t size) {
    size_t total = 0;
    ssize_t count = 1;
    while (count > 0) {
        gw_client_flush(&client);
        count = recv(peer, text == NULL ? big : &text[total], text == NULL ? sizeof big : size - total, 0);
        total += count > 0 ? (size_t)count : 0U;
    }
    return total;
}

static void test_client_byte_by_byte_makes_one_line_only_at_the_newline(void) {
    const char *text = "{\"cmd\":\"stop\"}";
    for (const char *c = text; *c != '\0'; c++) {
        const char byte[2] = {*c, '\0'};
        say(byte);
        expect_no_line();
    }
    say("\n");
    expect_line(text);
    expect_no_line();
}

static void test_client_several_lines_in_one_read_come_in_order_and_half_a_line_waits(void) {
    say("one\n\ntwo\nhal");
    expect_line("one");
    expect_line("");
    expect_line("two");
    expect_no_line();
    say("f\n");
    expect_line("half");
}

static void test_client_half_a_line_at_the_end_is_never_a_line(void) {
    say("stop");
    (void)shutdown(peer, SHUT_WR);
    gw_client_read(&client);
    TEST_ASSERT_TRUE(client.ended);
    expect_no_line();
}

static void test_client_line_of_4096_bytes_fits_and_4097_are_too_long(void) {
    TEST_ASSERT_EQUAL_INT(IWN_LINE_MAX, (int)send(peer, big, IWN_LINE_MAX, 0));
    gw_client_read(&client);
    TEST_ASSERT_FALSE(gw_client_line_too_long(&client));
    say("\n");
    TEST_ASSERT_FALSE(gw_client_line_too_long(&client));
    gw_client_drop_line(&client, IWN_LINE_MAX);
    TEST_ASSERT_EQUAL_UINT(0, client.in_length);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_MAX + 1, (int)send(peer, big, IWN_LINE_MAX + 1U, 0));
    gw_client_read(&client);
    TEST_ASSERT_TRUE(gw_client_line_too_long(&client));
}

static void test_client_reply_goes_out_whole(void) {
    char text[64] = "";
    gw_client_reply(&client, "hello\n", 6);
    TEST_ASSERT_FALSE(gw_client_flushed(&client));
    TEST_ASSERT_EQUAL_UINT(6, drain(text, sizeof text));
    TEST_ASSERT_EQUAL_STRING("hello\n", text);
    TEST_ASSERT_TRUE(gw_client_flushed(&client));
}

static void test_client_that_does_not_read_loses_events_and_is_told_how_many(void) {
    unsigned sent = 0;
    while (client.lost < 5U) { // Socket full, then our half full.
        gw_client_event(&client, big, 1000);
        gw_client_flush(&client);
        TEST_ASSERT_LESS_THAN_UINT(10000, sent++);
    }
    TEST_ASSERT_FALSE(client.failed);
    (void)drain(NULL, 0);
    gw_client_event(&client, "after\n", 6);
    char text[128] = "";
    (void)drain(text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("{\"event\":\"lost\",\"count\":5}\nafter\n", text);
    TEST_ASSERT_EQUAL_UINT32(0, client.lost);
}

static void test_client_room_for_the_longest_reply_is_kept_free_of_events(void) {
    while (client.lost == 0U) {
        gw_client_event(&client, big, 1000);
    }
    gw_client_reply(&client, big, GW_REPLY_MAX);
    TEST_ASSERT_FALSE(client.failed);
    gw_client_reply(&client, big, GW_REPLY_MAX);
    TEST_ASSERT_TRUE(client.failed);
}

static void test_client_event_to_one_that_is_leaving_is_dropped(void) {
    gw_client_finish(&client, 1000);
    gw_client_event(&client, "x\n", 2);
    TEST_ASSERT_TRUE(gw_client_flushed(&client));
    TEST_ASSERT_EQUAL_UINT64(1000U + GW_CLOSING_US, client.close_us);
    gw_client_finish(&client, 5000); // Only the first time counts.
    TEST_ASSERT_EQUAL_UINT64(1000U + GW_CLOSING_US, client.close_us);
}

static void test_client_gone_is_noticed_when_written_to(void) {
    (void)close(peer);
    gw_client_reply(&client, "x\n", 2);
    gw_client_flush(&client);
    TEST_ASSERT_TRUE(client.failed);
    peer = -1;
}

static void test_json_shows_by_number_what_moves_a_terminal_and_is_never_broken_utf8(void) {
    char line[256];
    iwn_out_t json;
    iwn_out_init(&json, line, sizeof line);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "t", "\x1b[2J\xC2\x9B\xE2\x80\xAE\xE2\x80\xA8\xD8\x9C\xE2\x81\xA9\x9B\xE2\x82\xAC\xE2\x82");
    iwn_out_close(&json, '}');
    line[iwn_out_finish(&json)] = '\0';
    TEST_ASSERT_EQUAL_STRING(
        "{\"t\":\"\\u001B[2J\\u009B\\u202E\\u2028\\u061C\\u2069\\uFFFD\xE2\x82\xAC\\uFFFD\\uFFFD\"}\n", line);
}

static void test_log_line_is_plain_whatever_stands_in_it(void) {
    char line[256] = "";
    int ends[2];
    gw_log_t log;
    const int before = dup(STDERR_FILENO);
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    TEST_ASSERT_EQUAL_INT(STDERR_FILENO, dup2(ends[1], STDERR_FILENO));
    gw_log_open(&log, GW_LOG_INFO);
    gw_log(&log, GW_LOG_INFO, "from %s", "\x1b[2J\n\xC2\x9B\xE2\x80\xAE\x9B\xC3\xA9");
    gw_log_close(&log);
    (void)dup2(before, STDERR_FILENO);
    (void)close(before);
    (void)close(ends[1]);
    TEST_ASSERT_GREATER_THAN(0, read(ends[0], line, sizeof line - 1U));
    (void)close(ends[0]);
    TEST_ASSERT_EQUAL_STRING("iwheel-gateway: info: from ?[2J????\xC3\xA9\n", line);
}

static void test_json_escapes_and_separates(void) {
    char line[256];
    iwn_out_t json;
    iwn_out_init(&json, line, sizeof line);
    iwn_out_open(&json, NULL, '{');
    iwn_out_int(&json, "low", INT64_MIN);
    iwn_out_text(&json, "t", "a\"b\\c\n\x7f\xE2\x82\xAC");
    iwn_out_open(&json, "list", '[');
    iwn_out_bool(&json, NULL, true);
    iwn_out_null(&json, NULL);
    iwn_out_close(&json, ']');
    iwn_out_open(&json, "empty", '{');
    iwn_out_close(&json, '}');
    iwn_out_known(&json, "k", false, 5);
    iwn_out_known(&json, "l", true, 5);
    iwn_out_text(&json, "n", NULL);
    iwn_out_close(&json, '}');
    const size_t length = iwn_out_finish(&json);
    line[length] = '\0';
    TEST_ASSERT_EQUAL_STRING(
        "{\"low\":-9223372036854775808,\"t\":\"a\\\"b\\\\c\\u000A\\u007F\xE2\x82\xAC\",\"list\":[true,null],"
        "\"empty\":{},\"k\":null,\"l\":5,\"n\":null}\n",
        line);
}

static void test_json_that_does_not_fit_is_no_line_at_any_size(void) {
    char line[64];
    for (size_t size = 1; size <= sizeof line; size++) {
        iwn_out_t json;
        memset(line, 0x5A, sizeof line);
        iwn_out_init(&json, line, size);
        iwn_out_open(&json, NULL, '{');
        iwn_out_text(&json, "event", "lost");
        iwn_out_close(&json, '}');
        const size_t whole = strlen("{\"event\":\"lost\"}\n");
        TEST_ASSERT_EQUAL_UINT(size > whole ? whole : 0U, iwn_out_finish(&json));
        for (size_t i = size; i < sizeof line; i++) {
            TEST_ASSERT_EQUAL_HEX8(0x5A, line[i]);
        }
    }
}

static const iwn_why_context_t context = {"\"joystick\" (client 3, pid 9)", "kerb", "unix:/e", "unix:/b"};

static const char *sentence(iw_cause_t cause, uint8_t sides, uint32_t detail) {
    static char text[IWN_SENTENCE_SIZE];
    iw_stop_t stop;
    memset(&stop, 0, sizeof stop);
    stop.number = 1;
    stop.cause = cause;
    stop.sides = sides;
    stop.detail = detail;
    stop.from = IW_STATE_ARMED;
    stop.at_us = 12345678;
    stop.latched = cause < IW_CAUSE_LOOP_LATE;
    stop.applied.wheel[IW_LEFT].speed_mm_s = 300;
    stop.applied.wheel[IW_RIGHT].speed_mm_s = -299;
    iwn_why_sentence(&stop, &context, text, sizeof text);
    return text;
}

static void test_why_names_cause_numbers_time_and_cure(void) {
    TEST_ASSERT_EQUAL_STRING(
        "left wheel not heard for 53 ms while driving 300/-299 mm/s; zero at once, latched at 12.345 s; "
        "check the wheel's power and cable, then: iwheelctl reset",
        sentence(IW_CAUSE_WHEEL_LOST, IW_SIDES_LEFT, 53));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_WHEEL_LOST, IW_SIDES_BOTH, UINT32_MAX), "both wheels never heard"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_SECOND_MASTER, 0, 266), "id 266 (0x10A)"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_ESTOP_SOFTWARE, 0, 3), "\"joystick\" (client 3, pid 9) (\"kerb\")"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_ESTOP_LINE, 0, 1), "e-stop unix:/e pressed"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_ESTOP_LINE, 0, 2), "unreadable"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_BUS_DOWN, 0, IW_BUS_OFF), "bus unix:/b is bus-off"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_LEASE_LOST, 0, 200), "no drive command for 200 ms"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_LEASE_LOST, 0, 200), "ramped to zero at 12.345 s"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_LOOP_LATE, 0, 130), "held up for 130 ms"));
    TEST_ASSERT_NOT_NULL(
        strstr(sentence(IW_CAUSE_WHEEL_BLOCKED, IW_SIDES_RIGHT, 12), "right wheel blocked: only 12 mm/s"));
}

static void test_why_after_a_crash_does_not_say_what_nobody_knows(void) {
    iw_stop_t stop;
    char text[IWN_SENTENCE_SIZE];
    memset(&stop, 0, sizeof stop);
    stop.number = 1;
    stop.cause = IW_CAUSE_RESTART;
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("the gateway before this one died while the wheels were armed; zero at once at 0.000 s; "
                             "look for the crash in the log, then arm again",
                             text);
}

static void test_why_has_a_sentence_and_a_name_for_every_cause(void) {
    for (unsigned cause = IW_CAUSE_ESTOP_LINE; cause < IW_CAUSES; cause++) {
        const char *text = sentence((iw_cause_t)cause, IW_SIDES_LEFT, 1);
        TEST_ASSERT_TRUE(strlen(text) > 60U);
        TEST_ASSERT_NOT_NULL(strstr(text, "12.345 s"));
        TEST_ASSERT_NULL_MESSAGE(strstr(text, "(null)"), text);
        TEST_ASSERT_TRUE(strcmp("unknown", iwn_cause_name((iw_cause_t)cause)) != 0);
        for (unsigned other = 0; other < cause; other++) {
            TEST_ASSERT_TRUE(strcmp(iwn_cause_name((iw_cause_t)other), iwn_cause_name((iw_cause_t)cause)) != 0);
        }
    }
    TEST_ASSERT_EQUAL_STRING("unknown", iwn_cause_name((iw_cause_t)IW_CAUSES));
}

static void test_why_without_a_stop_says_so(void) {
    char text[IWN_SENTENCE_SIZE];
    iw_stop_t stop;
    memset(&stop, 0, sizeof stop);
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("no stop since the gateway started", text);
}

static void test_names_of_all_refusals_are_errors_of_the_closed_list(void) {
    for (unsigned refusal = IW_REFUSE_OUT_OF_RANGE; refusal < IW_REFUSALS; refusal++) {
        const iwn_error_t error = iwn_error_of((iw_refusal_t)refusal);
        TEST_ASSERT_TRUE(error > IWN_OK && error < IWN_INTERNAL);
    }
    TEST_ASSERT_EQUAL_INT(IWN_OK, iwn_error_of(IW_REFUSE_NONE));
    TEST_ASSERT_EQUAL_INT(IWN_INTERNAL, iwn_error_of((iw_refusal_t)999));
    for (unsigned error = 0; error < IWN_ERRORS; error++) {
        TEST_ASSERT_TRUE(strcmp("unknown", iwn_error_name((iwn_error_t)error)) != 0);
    }
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; item++) {
        TEST_ASSERT_TRUE(strcmp("unknown", iwn_ledger_item_name((iw_ledger_item_t)item)) != 0);
    }
    TEST_ASSERT_EQUAL_STRING("offset_doubted", iwn_force_validity_name(IW_FORCE_OFFSET_DOUBTED));
    TEST_ASSERT_EQUAL_STRING("unreadable", iwn_estop_name(-1, true));
    TEST_ASSERT_EQUAL_STRING("none", iwn_estop_name(0, false));
}

static void test_client_request_right_after_calm_was_sent_now(void) {
    say("{}\n");
    client.caught_up_us = 1000000;
    TEST_ASSERT_EQUAL_UINT64(1025000, gw_client_sent_us(&client, 1025000, 0));
    TEST_ASSERT_EQUAL_UINT64(1000000, gw_client_sent_us(&client, 1025001, 0));
    TEST_ASSERT_EQUAL_UINT64(1000000, gw_client_sent_us(&client, 1000001, 1000001));
}

static void test_client_with_a_line_left_is_not_caught_up(void) {
    say("{}\n{}\n");
    gw_client_note_caught_up(&client, 5);
    expect_line("{}");
    gw_client_note_caught_up(&client, 6);
    TEST_ASSERT_EQUAL_UINT64(0, client.caught_up_us);
    expect_line("{}");
    gw_client_note_caught_up(&client, 7);
    TEST_ASSERT_EQUAL_UINT64(7, client.caught_up_us);
}

static void test_client_caught_up_later_is_not_forgotten_for_an_earlier_time(void) {
    gw_client_check_caught_up(&client, 9);
    gw_client_note_caught_up(&client, 8);
    TEST_ASSERT_EQUAL_UINT64(9, client.caught_up_us);
}

static void test_client_with_bytes_left_in_its_socket_is_not_caught_up(void) {
    TEST_ASSERT_EQUAL_INT(3, (int)send(peer, "{}\n", 3, MSG_NOSIGNAL));
    gw_client_check_caught_up(&client, 5);
    TEST_ASSERT_EQUAL_UINT64(0, client.caught_up_us);
    gw_client_read(&client);
    expect_line("{}");
    gw_client_check_caught_up(&client, 6);
    TEST_ASSERT_EQUAL_UINT64(6, client.caught_up_us);
}

static void test_client_that_filled_the_buffer_is_not_caught_up(void) {
    for (int i = 0; i < 3; ++i) {
        TEST_ASSERT_EQUAL_INT(4000, (int)send(peer, big, 4000, MSG_NOSIGNAL));
    }
    gw_client_read(&client);
    gw_client_note_caught_up(&client, 5);
    TEST_ASSERT_EQUAL_UINT64(0, client.caught_up_us);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_client_byte_by_byte_makes_one_line_only_at_the_newline);
    RUN_TEST(test_client_several_lines_in_one_read_come_in_order_and_half_a_line_waits);
    RUN_TEST(test_client_half_a_line_at_the_end_is_never_a_line);
    RUN_TEST(test_client_line_of_4096_bytes_fits_and_4097_are_too_long);
    RUN_TEST(test_client_reply_goes_out_whole);
    RUN_TEST(test_client_that_does_not_read_loses_events_and_is_told_how_many);
    RUN_TEST(test_client_room_for_the_longest_reply_is_kept_free_of_events);
    RUN_TEST(test_client_event_to_one_that_is_leaving_is_dropped);
    RUN_TEST(test_client_gone_is_noticed_when_written_to);
    RUN_TEST(test_json_shows_by_number_what_moves_a_terminal_and_is_never_broken_utf8);
    RUN_TEST(test_log_line_is_plain_whatever_stands_in_it);
    RUN_TEST(test_json_escapes_and_separates);
    RUN_TEST(test_json_that_does_not_fit_is_no_line_at_any_size);
    RUN_TEST(test_why_names_cause_numbers_time_and_cure);
    RUN_TEST(test_why_after_a_crash_does_not_say_what_nobody_knows);
    RUN_TEST(test_why_has_a_sentence_and_a_name_for_every_cause);
    RUN_TEST(test_why_without_a_stop_says_so);
    RUN_TEST(test_names_of_all_refusals_are_errors_of_the_closed_list);
    RUN_TEST(test_client_request_right_after_calm_was_sent_now);
    RUN_TEST(test_client_with_a_line_left_is_not_caught_up);
    RUN_TEST(test_client_caught_up_later_is_not_forgotten_for_an_earlier_time);
    RUN_TEST(test_client_with_bytes_left_in_its_socket_is_not_caught_up);
    RUN_TEST(test_client_that_filled_the_buffer_is_not_caught_up);
    return UNITY_END();
}
