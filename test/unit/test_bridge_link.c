// SPDX-License-Identifier: MIT
// Connections of a bridge to the gateway: questions wait in the bridge, stops do not wait.
#include "common/bridge_link.h"

#include "../support/fake_gateway.h"
#include "unit.h"

#include <stdio.h>
#include <string.h>

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

static void connect_both(void) {
    step();
    step();
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, WATCHES, line, sizeof line));
    TEST_ASSERT_NOT_NULL(strstr(line, "\"topics\":[\"state\",\"bus\",\"estop\",\"lease\",\"stop\"],\"rate_hz\":7"));
    fake_gateway_reply(&gateway, WATCHES, line, true, "");
    step();
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
        TEST_ASSERT_TRUE(bridge_link_ask(&link_, request, take_answer, NULL, now_us));
    }
    TEST_ASSERT_EQUAL_UINT64(now_us, bridge_link_next_us(&link_, now_us));
    step();
    for (int i = 0; i < 10; i++) {
        char number[24];
        (void)snprintf(number, sizeof number, "\"number\":%d}", i);
        TEST_ASSERT_TRUE(fake_gateway_read(&gateway, WATCHES, line, sizeof line));
        TEST_ASSERT_NOT_NULL(strstr(line, number));
        TEST_ASSERT_EQUAL((i < 7) ? 4 : 10 - i, (int)bridge_line_in_flight(&link_.line));
        fake_gateway_reply(&gateway, WATCHES, line, true, "");
        step();
    }
    TEST_ASSERT_EQUAL(10, answered);
}

TEST(test_question_beyond_the_queue_is_not_accepted) {
    connect_both();
    for (unsigned i = 0; i < BRIDGE_ASKED_MAX; i++) {
        TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"status\"}", take_answer, NULL, now_us));
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
    TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"why\"}", take_answer, NULL, now_us));
    bridge_link_forget(&link_, &who);
    step();
    TEST_ASSERT_EQUAL(1, read_all(WATCHES));
    TEST_ASSERT_EQUAL(0, answered + refused);
}

TEST(test_stop_never_waits_for_questions) {
    connect_both();
    for (unsigned i = 0; i < BRIDGE_ASKED_MAX; i++) {
        TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"status\"}", take_answer, NULL, now_us));
    }
    TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"stop\"}", take_answer, NULL, now_us));
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, STOPS, line, sizeof line)); // No further step is needed.
    TEST_ASSERT_NOT_NULL(strstr(line, "\"cmd\":\"stop\""));
    fake_gateway_reply(&gateway, STOPS, line, true, "");
    step();
    TEST_ASSERT_EQUAL(1, answered);
}

TEST(test_stop_never_queues_behind_stops) {
    connect_both();
    for (int i = 0; i < 300; i++) {
        TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"stop\"}", take_answer, NULL, now_us));
    }
    TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"estop\",\"reason\":\"a\"}", take_answer, NULL, now_us));
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, STOPS, line, sizeof line));
    fake_gateway_reply(&gateway, STOPS, line, true, "");
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, STOPS, line, sizeof line));
    TEST_ASSERT_NOT_NULL(strstr(line, "\"cmd\":\"estop\""));
    fake_gateway_reply(&gateway, STOPS, line, true, "");
    step();
    TEST_ASSERT_EQUAL(2, answered); // A stop that was already sent does not answer later requests.
    TEST_ASSERT_EQUAL(1, read_all(STOPS));
    fake_gateway_reply(&gateway, STOPS, line, true, "");
    step();
    TEST_ASSERT_EQUAL(301, answered);
    TEST_ASSERT_EQUAL(0, refused);
}

TEST(test_stop_without_reply_is_reported_and_reconnects) {
    connect_both();
    TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"stop\"}", take_answer, NULL, now_us));
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
    TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"estop\"}", take_answer, NULL, now_us));
    step();
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, 2, line, sizeof line));
    TEST_ASSERT_NOT_NULL(strstr(line, "\"cmd\":\"estop\""));
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
    TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"stop\"}", take_answer, NULL, now_us));
    now_us += BRIDGE_STOP_US;
    step();
    TEST_ASSERT_EQUAL(1, refused);
    now_us += BRIDGE_GREETING_US;
    step();
    TEST_ASSERT_EQUAL(BRIDGE_AWAY, link_.line.state);
    TEST_ASSERT_GREATER_THAN_UINT64(now_us, bridge_link_next_us(&link_, now_us));
}

TEST(test_stop_after_timeout_is_not_sent_late) {
    gateway.greets = false;
    step();
    step();
    TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"stop\"}", take_answer, NULL, now_us));
    now_us += BRIDGE_STOP_US;
    step();
    TEST_ASSERT_EQUAL(1, refused);
    fake_gateway_send(&gateway, STOPS, "{\"event\":\"hello\",\"api\":1,\"client\":1,\"rights\":\"drive\"}");
    step();
    step();
    TEST_ASSERT_EQUAL(BRIDGE_HERE, link_.stop.line.state);
    TEST_ASSERT_EQUAL(0, read_all(STOPS));
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

TEST(test_link_lost_gateway_answers_each_question_once) {
    connect_both();
    for (int i = 0; i < 9; i++) {
        TEST_ASSERT_TRUE(bridge_link_ask(&link_, "{\"cmd\":\"status\"}", take_answer, NULL, now_us));
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
    fake_gateway_reply(&gateway, 2, line, true, "");
    step();
    TEST_ASSERT_EQUAL(2, here);
    TEST_ASSERT_FALSE(fake_gateway_read(&gateway, 2, line, sizeof line)); // No question is sent twice.
}
