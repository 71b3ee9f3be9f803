// SPDX-License-Identifier: MIT
// Lease of a bridge: one person, one connection that drives, one key.
#include "common/lease.h"

#include "../support/fake_gateway.h"
#include "unit.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

#define MS 1000U

static fake_gateway_t gateway;
static bridge_lease_t lease;
static int epoll_fd;
static uint64_t now_us;
static int answered;
static int refused; // Answers with NULL.
static char last[400];
static char line[2000];
static char armed_key[BRIDGE_SECRET_SIZE];

static const char *const ARM = "{\"cmd\":\"arm\",\"name\":\"a\"}";
static const char *const DRIVE = "{\"cmd\":\"drive\",\"left_mm_s\":100,\"right_mm_s\":100}";
static const char *const GRANTED = ",\"state\":\"armed\",\"key\":\"00112233445566778899aabbccddeeff\"";
static const char *const KEY = "00112233445566778899aabbccddeeff";

static void take_answer(void *context, const iwc_message_t *reply) {
    (void)context;
    *((reply != NULL) ? &answered : &refused) += 1;
    (void)snprintf(last, sizeof last, "%s", (reply != NULL) ? reply->text : "");
    (void)snprintf(armed_key, sizeof armed_key, "%s",
                   (bridge_lease_key(&lease) != NULL) ? bridge_lease_key(&lease) : "");
}

static void step(void) {
    fake_gateway_accept(&gateway);
    bridge_lease_step(&lease, now_us);
}

void setUp(void) {
    fake_gateway_open(&gateway);
    now_us = 10000000U;
    answered = refused = 0;
    armed_key[0] = '\0';
    epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    TEST_ASSERT_TRUE(bridge_lease_open(&lease, gateway.path, epoll_fd));
}

void tearDown(void) {
    bridge_lease_close(&lease);
    (void)close(epoll_fd);
    fake_gateway_close(&gateway);
}

static bridge_lease_result_t ask_arm(const char *name) {
    return bridge_lease_arm(&lease, name, ARM, (bridge_asker_t){take_answer, NULL}, now_us);
}

static bridge_lease_result_t drive(const char *key) {
    return bridge_lease_drive(&lease, key, DRIVE, (bridge_asker_t){take_answer, NULL}, now_us);
}

/// Arms on the next connection; the reply of the gateway contains `fields`.
static void arm(const char *name, bool ok, const char *fields) {
    const int connection = gateway.count;
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, ask_arm(name));
    step();
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, connection, line, sizeof line));
    fake_gateway_reply(&gateway, connection, line, ok, fields);
    step();
}

TEST(test_lease_viewer_has_no_connection) {
    step();
    TEST_ASSERT_EQUAL(0, gateway.count);
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, bridge_lease_next_us(&lease, now_us));
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_WRONG, drive(KEY));
}

TEST(test_one_person_gateway_key_is_sent_in_each_drive) {
    arm("a", true, GRANTED);
    TEST_ASSERT_EQUAL_STRING(KEY, armed_key);
    TEST_ASSERT_EQUAL_STRING("a", bridge_lease_name(&lease));
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, drive(KEY));
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, 0, line, sizeof line));
    TEST_ASSERT_NOT_NULL(strstr(line, "\"right_mm_s\":100,\"key\":\"00112233445566778899aabbccddeeff\"}"));
}

TEST(test_one_person_without_gateway_key_gets_a_random_key) {
    arm("a", true, ",\"state\":\"armed\"");
    TEST_ASSERT_EQUAL(32, strlen(armed_key));
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, drive(armed_key));
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, 0, line, sizeof line));
    TEST_ASSERT_NULL(strstr(line, "key"));
}

TEST(test_one_person_other_key_never_drives) {
    static const char *const wrong[] = {NULL, "", "00112233445566778899aabbccddeefe", "00112233445566778899aabbccddeef",
                                        "00112233445566778899aabbccddeefff"};
    arm("a", true, GRANTED);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_EQUAL(BRIDGE_LEASE_WRONG, drive(wrong[i]));
    }
    TEST_ASSERT_FALSE(fake_gateway_read(&gateway, 0, line, sizeof line));
}

TEST(test_one_person_second_is_refused_and_first_drives_on) {
    arm("a", true, GRANTED);
    arm("b", false, ",\"error\":\"busy\",\"message\":\"a drives\"");
    TEST_ASSERT_NOT_NULL(strstr(last, "busy"));
    TEST_ASSERT_TRUE(fake_gateway_is_closed(&gateway, 1));
    TEST_ASSERT_FALSE(fake_gateway_is_closed(&gateway, 0));
    TEST_ASSERT_EQUAL_STRING("a", bridge_lease_name(&lease));
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, bridge_lease_drive(&lease, KEY, DRIVE, (bridge_asker_t){NULL, NULL}, now_us));
}

TEST(test_one_person_third_is_busy_while_second_asks) {
    arm("a", true, GRANTED);
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, ask_arm("b"));
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_BUSY, ask_arm("c"));
    step();
    TEST_ASSERT_EQUAL(2, gateway.count);
}

TEST(test_one_person_takeover_ends_the_previous_holder) {
    arm("a", true, GRANTED);
    arm("b", true, ",\"key\":\"ffeeddccbbaa99887766554433221100\"");
    TEST_ASSERT_EQUAL_STRING("b", bridge_lease_name(&lease));
    TEST_ASSERT_TRUE(fake_gateway_is_closed(&gateway, 0));
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_WRONG, drive(KEY));
}

TEST(test_lease_end_voids_the_key_before_the_connection) {
    arm("a", true, GRANTED);
    bridge_lease_end(&lease, now_us);
    TEST_ASSERT_NULL(bridge_lease_name(&lease));
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_WRONG, drive(KEY));
    TEST_ASSERT_FALSE(fake_gateway_is_closed(&gateway, 0));
    TEST_ASSERT_EQUAL_UINT64(now_us + BRIDGE_ENDING_US, bridge_lease_next_us(&lease, now_us));
    now_us += BRIDGE_ENDING_US;
    step();
    TEST_ASSERT_TRUE(fake_gateway_is_closed(&gateway, 0));
}

TEST(test_lease_ending_connection_frees_its_place_for_arm) {
    arm("a", true, GRANTED);
    bridge_lease_end(&lease, now_us);
    arm("b", true, GRANTED);
    bridge_lease_end(&lease, now_us);
    arm("c", true, GRANTED);
    TEST_ASSERT_EQUAL_STRING("c", bridge_lease_name(&lease));
    TEST_ASSERT_TRUE(fake_gateway_is_closed(&gateway, 0) || fake_gateway_is_closed(&gateway, 1));
}

TEST(test_lease_end_refuses_the_pending_arm) {
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, ask_arm("a"));
    step();
    bridge_lease_end(&lease, now_us);
    TEST_ASSERT_EQUAL(1, refused);
    TEST_ASSERT_NULL(bridge_lease_name(&lease));
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, 0, line, sizeof line)); // The arm request; then the connection ends.
    TEST_ASSERT_TRUE(fake_gateway_is_closed(&gateway, 0));
}

TEST(test_lease_forgotten_asker_gets_no_lease) {
    int who = 0;
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, bridge_lease_arm(&lease, "a", ARM, (bridge_asker_t){take_answer, &who}, now_us));
    step();
    bridge_lease_forget(&lease, &who);
    TEST_ASSERT_EQUAL(0, answered + refused);
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, 0, line, sizeof line));
    TEST_ASSERT_TRUE(fake_gateway_is_closed(&gateway, 0));
}

TEST(test_lease_reply_not_holder_ends_the_lease) {
    arm("a", true, GRANTED);
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, drive(KEY));
    TEST_ASSERT_TRUE(fake_gateway_read(&gateway, 0, line, sizeof line));
    fake_gateway_reply(&gateway, 0, line, false, ",\"error\":\"not_holder\",\"message\":\"m\"");
    step();
    TEST_ASSERT_NOT_NULL(strstr(last, "not_holder"));
    TEST_ASSERT_NULL(bridge_lease_name(&lease));
    TEST_ASSERT_TRUE(fake_gateway_is_closed(&gateway, 0));
}

TEST(test_lease_lost_connection_answers_drives_once) {
    arm("a", true, GRANTED);
    for (int i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, drive(KEY));
    }
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_FULL, drive(KEY));
    fake_gateway_hang_up(&gateway, 0);
    step();
    TEST_ASSERT_EQUAL(4, refused);
    TEST_ASSERT_NULL(bridge_lease_name(&lease));
}

TEST(test_lease_arm_without_reply_is_refused_after_timeout) {
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_OK, ask_arm("a"));
    step();
    now_us += BRIDGE_ARM_US;
    step();
    TEST_ASSERT_EQUAL(1, refused);
    fake_gateway_close(&gateway);
    TEST_ASSERT_EQUAL(BRIDGE_LEASE_AWAY, ask_arm("a"));
}

TEST(test_movers_deflected_stick_is_named_for_its_duration) {
    bridge_movers_t movers = {0};
    TEST_ASSERT_NULL(bridge_movers_who(&movers, NULL, 200, now_us));
    bridge_movers_note(&movers, "b", now_us);
    TEST_ASSERT_EQUAL_STRING("b", bridge_movers_who(&movers, NULL, 200, now_us + 499U * MS));
    TEST_ASSERT_EQUAL_STRING("b", bridge_movers_who(&movers, "a", 200, now_us));
    TEST_ASSERT_NULL(bridge_movers_who(&movers, "b", 200, now_us));
    TEST_ASSERT_NULL(bridge_movers_who(&movers, NULL, 200, now_us + 500U * MS));
    TEST_ASSERT_EQUAL_STRING("b", bridge_movers_who(&movers, NULL, 800, now_us + 799U * MS));
}

TEST(test_movers_many_sources_replace_the_oldest) {
    bridge_movers_t movers = {0};
    char name[8];
    for (unsigned i = 0; i < 3U * BRIDGE_MOVERS_MAX; i++) {
        (void)snprintf(name, sizeof name, "n%u", i);
        bridge_movers_note(&movers, name, now_us + i);
        TEST_ASSERT_NOT_NULL(bridge_movers_who(&movers, NULL, 200, now_us + i));
    }
    bridge_movers_note(&movers, name, now_us + 1000U * MS);
    TEST_ASSERT_EQUAL_STRING(name, bridge_movers_who(&movers, NULL, 200, now_us + 1000U * MS));
}
