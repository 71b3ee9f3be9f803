// SPDX-License-Identifier: MIT
// Connections of a bridge to the gateway: questions wait in the bridge, stops do not wait.
#include "common/bridge_link.h"

#include "../support/fake_gateway.h"
#include "unit.h"

#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define MS 1000U

static fake_gateway_t gateway;
static bridge_link_t link_;
static uint64_t now_us;
static int here;
static int gone;
static int events;
static int answered;
static int refused; // Answers with NULL.
static char line[2000];

// Order in which the bridge connects: first the connection for stops.
enum { STOPS, WATCHES };

static void take_here(void *context, uint64_t at_us) {
    (void)context;
    (void)at_us;
    here++;
}

static void take_gone(void *context, uint64_t at_us) {
    (void)context;
    (void)at_us;
    gone++;
}

static void take_event(void *context, const iwc_message_t *event, uint64_t at_us) {
    (void)context;
    (void)event;
    (void)at_us;
    events++;
}

static void take_answer(void *context, const iwc_message_t *reply) {
    (void)context;
    *((reply != NULL) ? &answered : &refused) += 1;
}

static void step(void) {
    fake_gateway_accept(&gateway);
    TEST_ASSERT_EQUAL(0, bridge_link_step(&link_, now_us));
}

static void assert_line(int connection, const char *words) {
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, connection, line, sizeof line));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line, words), line);
}

static void accept_line(int connection) {
    fake_gateway_reply(&gateway, connection, line, true, "");
    step();
}

static void ask(const char *request) {
    TEST_ASSERT_TRUE(bridge_link_ask(&link_, request, take_answer, NULL, now_us));
}

static void connect_both(void) {
    step();
    step();
    assert_line(WATCHES, "\"topics\":[\"state\",\"bus\",\"estop\",\"lease\",\"stop\"],\"rate_hz\":7");
    accept_line(WATCHES);
    TEST_ASSERT_EQUAL(BRIDGE_LINK_HERE, link_.state);
}

void setUp(void) {
    fake_gateway_open(&gateway);
    const bridge_link_terms_t terms = {"test", gateway.path, 7, false, false};
    const bridge_listener_t listener = {NULL, take_here, take_gone, take_event};
    now_us = 10000000U;
    here = gone = events = answered = refused = 0;
    TEST_ASSERT_TRUE(bridge_link_open(&link_, &terms, &listener));
}

void tearDown(void) {
    bridge_link_close(&link_);
    fake_gateway_close(&gateway);
}

static int read_all(int connection) {
    int count = 0;
    while (fake_gateway_read(&gateway, connection, line, sizeof line)) {
        count++;
    }
    return count;
}

TEST(test_link_start_opens_watch_and_stop_connection) {
    connect_both();
    TEST_ASSERT_EQUAL(2, gateway.count);
    TEST_ASSERT_EQUAL(1, here);
    TEST_ASSERT_FALSE(fake_gateway_read(&gateway, STOPS, line, sizeof line));
}

TEST(test_questions_beyond_four_wait_in_order) {
    connect_both();
    for (int i = 0; i < 10; i++) {
        char request[40];
        (void)snprintf(request, sizeof request, "{\"cmd\":\"status\",\"number\":%d}", i);
        ask(request);
    }
    TEST_ASSERT_EQUAL_UINT64(now_us, bridge_link_next_us(&link_, now_us));
    step();
    for (int i = 0; i < 10; i++) {
        char number[24];
        (void)snprintf(number, sizeof number, "\"number\":%d}", i);
        assert_line(WATCHES, number);
        TEST_ASSERT_EQUAL((i < 7) ? 4 : 10 - i, (int)bridge_line_in_flight(&link_.line));
        accept_line(WATCHES);
    }
    TEST_ASSERT_EQUAL(10, answered);
}

TEST(test_question_beyond_the_queue_is_not_accepted) {
    connect_both();
    for (unsigned i = 0; i < BRIDGE_ASKED_MAX; i++) {
        ask("{\"cmd\":\"status\"}");
    }
    TEST_ASSERT_FALSE(bridge_link_ask(&link_, "{\"cmd\":\"status\"}", take_answer, NULL, now_us));
    step();
    now_us += BRIDGE_ANSWER_US;
    step();
    step();
    TEST_ASSERT_EQUAL(BRIDGE_ASKED_MAX, refused);
    TEST_ASSERT_EQUAL(BRIDGE_LINK_HERE, link_.state);
}

TEST(test_forgotten_question_is_not_sent) {
    int who = 0;
    connect_both();
    for (int i = 0; i < 8; i++) {
        TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"status\"}", take_answer, &who, now_us));
    }
    ask("{\"cmd\":\"why\"}");
    bridge_link_forget(&link_, &who);
    step();
    TEST_ASSERT_EQUAL(1, read_all(WATCHES));
    TEST_ASSERT_EQUAL(0, answered + refused);
}

static void assert_stop_is_sent_at_once(void) {
    ask("{\"cmd\":\"stop\"}");
    assert_line(STOPS, "\"cmd\":\"stop\""); // No further step is needed.
    accept_line(STOPS);
    TEST_ASSERT_EQUAL(1, answered);
}

TEST(test_stop_never_waits_for_questions) {
    connect_both();
    for (unsigned i = 0; i < BRIDGE_ASKED_MAX; i++) {
        ask("{\"cmd\":\"status\"}");
    }
    assert_stop_is_sent_at_once();
}

TEST(test_stop_never_queues_behind_stops) {
    connect_both();
    for (int i = 0; i < 300; i++) {
        ask("{\"cmd\":\"stop\"}");
    }
    ask("{\"cmd\":\"estop\",\"reason\":\"a\"}");
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, STOPS, line, sizeof line));
    fake_gateway_reply(&gateway, STOPS, line, true, "");
    assert_line(STOPS, "\"cmd\":\"estop\"");
    accept_line(STOPS);
    TEST_ASSERT_EQUAL(2, answered); // A stop that was already sent does not answer later requests.
    TEST_ASSERT_EQUAL(1, read_all(STOPS));
    accept_line(STOPS);
    TEST_ASSERT_EQUAL(301, answered);
    TEST_ASSERT_EQUAL(0, refused);
}

TEST(test_stop_without_reply_is_reported_and_reconnects) {
    connect_both();
    ask("{\"cmd\":\"stop\"}");
    now_us += BRIDGE_STOP_US - 1U;
    step();
    TEST_ASSERT_EQUAL(0, refused);
    now_us += 1U;
    step();
    TEST_ASSERT_EQUAL(1, refused);
    TEST_ASSERT_EQUAL(BRIDGE_LINK_HERE, link_.state); // The connection for watching stays.
    now_us += 3000U * MS;
    step();
    step();
    TEST_ASSERT_EQUAL(BRIDGE_HERE, link_.stop.line.state);
    TEST_ASSERT_EQUAL(0, read_all(2)); // The stop is not sent late.
}

TEST(test_stop_on_lost_connection_connects_immediately) {
    connect_both();
    fake_gateway_hang_up(&gateway, STOPS);
    step();
    TEST_ASSERT_EQUAL(BRIDGE_AWAY, link_.stop.line.state);
    ask("{\"cmd\":\"estop\"}");
    step();
    assert_line(2, "\"cmd\":\"estop\"");
}

TEST(test_stop_without_gateway_is_not_accepted) {
    connect_both();
    fake_gateway_close(&gateway);
    step();
    TEST_ASSERT_EQUAL(1, gone);
    TEST_ASSERT_FALSE(bridge_link_ask(&link_, "{\"cmd\":\"stop\"}", take_answer, NULL, now_us));
    TEST_ASSERT_FALSE(bridge_link_ask(&link_, "{\"cmd\":\"why\"}", take_answer, NULL, now_us));
    TEST_ASSERT_EQUAL(0, answered + refused);
}

TEST(test_link_gateway_without_greeting_times_out) {
    gateway.greets = false;
    step();
    step();
    TEST_ASSERT_NOT_EQUAL(BRIDGE_LINK_HERE, link_.state);
    ask("{\"cmd\":\"stop\"}");
    now_us += BRIDGE_STOP_US;
    step();
    TEST_ASSERT_EQUAL(1, refused);
    now_us += BRIDGE_GREETING_US;
    step();
    TEST_ASSERT_EQUAL(BRIDGE_AWAY, link_.line.state);
    TEST_ASSERT_GREATER_THAN_UINT64(now_us, bridge_link_next_us(&link_, now_us));
}

static int knock(void) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", gateway.path);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
    if (connect(fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        (void)close(fd);
        return -1;
    }
    return fd;
}

/// The gateway accepts no connection until after the time of the stop.
TEST(test_stop_after_timeout_is_not_sent_late) {
    int others[FAKE_CONNECTIONS];
    int count = 0;
    connect_both();
    fake_gateway_hang_up(&gateway, STOPS);
    (void)bridge_link_step(&link_, now_us);
    while ((others[count] = knock()) >= 0) {
        count++;
        TEST_ASSERT_LESS_THAN(FAKE_CONNECTIONS - 4, count);
    }
    ask("{\"cmd\":\"stop\"}");
    now_us += BRIDGE_STOP_US;
    (void)bridge_link_step(&link_, now_us);
    TEST_ASSERT_EQUAL(1, refused);
    fake_gateway_accept(&gateway);
    now_us += 3000U * MS;
    step();
    step();
    TEST_ASSERT_EQUAL(BRIDGE_HERE, link_.stop.line.state);
    TEST_ASSERT_EQUAL(0, read_all(gateway.count - 1));
    while (count > 0) {
        (void)close(others[--count]);
    }
}

/// All places of the gateway are in use: it sends no greeting, executes one stop, and closes a connection without one.
TEST(test_stop_needs_no_greeting) {
    gateway.greets = false;
    step();
    step();
    assert_stop_is_sent_at_once();
    fake_gateway_send(&gateway, STOPS,
                      "{\"id\":null,\"ok\":false,\"error\":\"too_many_clients\",\"message\":\"full\"}");
    fake_gateway_hang_up(&gateway, STOPS);
    step();
    const int next = gateway.count;
    ask("{\"cmd\":\"estop\"}");
    fake_gateway_accept(&gateway);
    assert_line(next, "\"cmd\":\"estop\""); // On a new connection, also without a step.
    TEST_ASSERT_EQUAL(0, refused);
}

TEST(test_link_full_gateway_is_retried_with_pauses) {
    gateway.greets = false;
    for (int i = 0; i < 20; i++) {
        const int before = gateway.count;
        step();
        fake_gateway_accept(&gateway);
        for (int j = before; j < gateway.count; j++) {
            fake_gateway_send(&gateway, j,
                              "{\"id\":null,\"ok\":false,\"error\":\"too_many_clients\",\"message\":\"full\"}");
            fake_gateway_hang_up(&gateway, j);
        }
        now_us += 10U * MS;
    }
    TEST_ASSERT_LESS_OR_EQUAL(6, gateway.count);
    TEST_ASSERT_EQUAL(0, here);
}

static void hear(long long t_us) {
    char event[64];
    (void)snprintf(event, sizeof event, "{\"event\":\"state\",\"t_us\":%lld}", t_us);
    fake_gateway_send(&gateway, WATCHES, event);
    step();
}

/// A board whose clock began an hour later, and runs 100 ppm slower.
TEST(test_link_clock_is_that_of_the_fastest_event) {
    const long long hour_us = 3600LL * 1000000;
    const long long first_us = (long long)now_us;
    now_us += (uint64_t)hour_us;
    connect_both();
    TEST_ASSERT_EQUAL_INT64(0, bridge_link_ahead_us(&link_, now_us));
    now_us += 40U * MS;
    hear(first_us);
    TEST_ASSERT_EQUAL_INT64(-hour_us - 40000, bridge_link_ahead_us(&link_, now_us));
    now_us += 100U * MS;
    hear(first_us + 135000); // 5 ms on the way.
    TEST_ASSERT_EQUAL_INT64(-hour_us - 5000, bridge_link_ahead_us(&link_, now_us));
    now_us += 2000U * MS;
    hear(first_us + 200000); // Late by more than a second: the clock stays, but for its drift.
    TEST_ASSERT_EQUAL_INT64(-hour_us - 5400, bridge_link_ahead_us(&link_, now_us));
    for (int i = 0; i < 100; i++) {
        now_us += 1000U * MS;
        hear(first_us + 2140000 + (i + 1) * 999900LL);
    }
    TEST_ASSERT_INT64_WITHIN(300, -hour_us - 10000, bridge_link_ahead_us(&link_, now_us));
    fake_gateway_hang_up(&gateway, WATCHES);
    step();
    TEST_ASSERT_EQUAL_INT64(0, bridge_link_ahead_us(&link_, now_us));
}

TEST(test_link_clock_of_a_gateway_on_this_machine_is_the_same) {
    connect_both();
    hear((long long)now_us - 99999);
    TEST_ASSERT_EQUAL_INT64(0, bridge_link_ahead_us(&link_, now_us));
    fake_gateway_hang_up(&gateway, WATCHES);
    step();
    now_us += 3000U * MS;
    const int next = gateway.count;
    step();
    step();
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, next, line, sizeof line));
    fake_gateway_reply(&gateway, next, line, true, "");
    fake_gateway_send(&gateway, next, "{\"event\":\"state\",\"t_us\":0}");
    step();
    TEST_ASSERT_EQUAL_INT64(-(int64_t)now_us, bridge_link_ahead_us(&link_, now_us));
}

TEST(test_link_lost_gateway_answers_each_question_once) {
    connect_both();
    for (int i = 0; i < 9; i++) {
        ask("{\"cmd\":\"status\"}");
    }
    step();
    fake_gateway_send(&gateway, WATCHES, "{\"event\":\"state\",\"t_us\":5}");
    step();
    TEST_ASSERT_EQUAL(1, events);
    fake_gateway_hang_up(&gateway, WATCHES);
    step();
    TEST_ASSERT_EQUAL(9, refused);
    TEST_ASSERT_EQUAL(1, gone);
    now_us += 3000U * MS;
    step();
    step();
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, 2, line, sizeof line));
    accept_line(2);
    TEST_ASSERT_EQUAL(2, here);
    TEST_ASSERT_FALSE(fake_gateway_read(&gateway, 2, line, sizeof line)); // No question is sent twice.
}

TEST(test_rate_change_is_asked_once) {
    connect_both();
    bridge_link_rate(&link_, 7, now_us);
    step();
    TEST_ASSERT_EQUAL(0, read_all(WATCHES));
    bridge_link_rate(&link_, 2, now_us);
    bridge_link_rate(&link_, 2, now_us);
    TEST_ASSERT_EQUAL_UINT64(now_us, bridge_link_next_us(&link_, now_us));
    step();
    assert_line(WATCHES, "\"topics\":[\"state\",\"bus\",\"estop\",\"lease\",\"stop\"],\"rate_hz\":2");
    accept_line(WATCHES);
    TEST_ASSERT_EQUAL(0, read_all(WATCHES));
    TEST_ASSERT_EQUAL(1, here);
}

TEST(test_rate_change_with_full_queue_is_asked_later) {
    connect_both();
    while (bridge_link_ask(&link_, "{\"cmd\":\"status\"}", take_answer, NULL, now_us)) {
    }
    bridge_link_rate(&link_, 2, now_us);
    TEST_ASSERT_EQUAL(7, link_.terms.rate_hz);
    now_us += BRIDGE_ANSWER_US;
    step();
    bridge_link_rate(&link_, 2, now_us);
    TEST_ASSERT_EQUAL(2, link_.terms.rate_hz);
}

TEST(test_rate_change_while_away_is_subscribed) {
    bridge_link_rate(&link_, 3, now_us);
    step();
    step();
    assert_line(WATCHES, "\"rate_hz\":3");
    accept_line(WATCHES);
    TEST_ASSERT_EQUAL(0, read_all(WATCHES));
}

TEST(test_rate_change_while_subscribing_is_asked_later) {
    step();
    step();
    assert_line(WATCHES, "\"rate_hz\":7");
    bridge_link_rate(&link_, 2, now_us); // The gateway has only the old rate.
    accept_line(WATCHES);
    bridge_link_rate(&link_, 2, now_us);
    step();
    assert_line(WATCHES, "\"rate_hz\":2");
}
