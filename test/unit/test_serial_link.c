// SPDX-License-Identifier: MIT
// State of the board at the relay: its start, the stamps with their times of receipt, and bytes that the relay could
// not parse.
#include "serial_link.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>

#define BOOT  "0123456789abcdef"
#define OTHER "fedcba9876543210"

static serial_link_t state;
static iwn_line_t line;

void setUp(void) {
    memset(&state, 0, sizeof state);
    serial_link_init(&state, 0);
}

/// Returns the last event of these bytes.
static serial_news_t receive_raw(const char *bytes, uint64_t now_us) {
    serial_news_t news = SERIAL_NEWS_NONE;
    for (const char *c = bytes; *c != '\0'; c++) {
        news = serial_link_put(&state, *c, now_us, &line);
    }
    return news;
}

static serial_news_t receive(uint8_t channel, uint64_t t_us, const char *json, uint64_t now_us) {
    const iwn_line_t sent = {.channel = channel, .stamped = true, .t_us = t_us, .json = json, .length = strlen(json)};
    char bytes[512];
    bytes[iwn_line_write(&sent, bytes, sizeof bytes - 1U)] = '\0';
    return receive_raw(bytes, now_us);
}

static serial_news_t receive_link(const char *boot, uint64_t t_us, uint64_t now_us) {
    char json[128];
    (void)snprintf(json, sizeof json, "{\"event\":\"link\",\"boot\":\"%s\",\"version\":\"1\"}", boot);
    return receive(0, t_us, json, now_us);
}

static uint64_t stamp_at(uint64_t then_us) {
    uint64_t t_us = UINT64_MAX;
    return serial_link_stamp(&state, then_us, &t_us) ? t_us : UINT64_MAX;
}

TEST(test_link_is_up_from_its_event_on) {
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_NONE, receive(1, 1, "{\"ok\":true}", 10));
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_LINKED, receive_link(BOOT, 5, 20));
    TEST_ASSERT_EQUAL_STRING(BOOT, state.boot);
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_NONE, receive_link(BOOT, 6, 30));
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_LINE, receive(1, 7, "{\"ok\":true}", 40));
    TEST_ASSERT_EQUAL_UINT(1, line.channel);
}

/// It is never later than the newest stamp, so never ahead of the board's clock.
TEST(test_link_time_is_counted_back_from_the_newest_stamp) {
    (void)receive_link(BOOT, 500000, 1000000);
    TEST_ASSERT_EQUAL_UINT64(400000, serial_link_time(&state, 900000));
    TEST_ASSERT_EQUAL_UINT64(500000, serial_link_time(&state, 1000001));
    TEST_ASSERT_EQUAL_UINT64(0, serial_link_time(&state, 300000));
    (void)receive(1, 600000, "{\"ok\":true}", 1200000);
    TEST_ASSERT_EQUAL_UINT64(400000, serial_link_time(&state, 1000000));
}

TEST(test_link_another_boot_is_a_new_link) {
    (void)receive_link(BOOT, 5000000, 10);
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_LINKED, receive_link(OTHER, 6000000, 20));
    TEST_ASSERT_EQUAL_STRING(OTHER, state.boot);
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, stamp_at(10));
    TEST_ASSERT_EQUAL_UINT64(6000000, stamp_at(20));
}

TEST(test_link_stamp_that_decreases_is_a_restart) {
    (void)receive_link(BOOT, 5000000, 10);
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_LOST, receive(2, 4000, "{\"event\":\"state\"}", 20));
    TEST_ASSERT_EQUAL(SERIAL_SILENT, state.state);
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, stamp_at(30));
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_LINKED, receive_link(OTHER, 5000, 30));
}

TEST(test_link_stamp_is_the_newest_received_by_that_time) {
    (void)receive_link(BOOT, 100, 1000);
    for (unsigned i = 1; i <= 100U; i++) {
        (void)receive(1, 100U + i * 20000U, "{}", 1000U + i * 20000U);
    }
    TEST_ASSERT_EQUAL_UINT64(100U + 100U * 20000U, stamp_at(1000U + 100U * 20000U));
    TEST_ASSERT_EQUAL_UINT64(100U + 99U * 20000U, stamp_at(999U + 100U * 20000U));
    TEST_ASSERT_EQUAL_UINT64(100U + 80U * 20000U, stamp_at(1000U + 80U * 20000U + 3U));
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, stamp_at(1000U)); // Longer ago than the life of any command.
}

TEST(test_link_stamps_at_short_intervals_cover_the_same_time) {
    (void)receive_link(BOOT, 100, 1000);
    for (unsigned i = 1; i <= 1000U; i++) {
        (void)receive(1, 100U + i * 200U, "{}", 1000U + i * 200U);
    }
    TEST_ASSERT_EQUAL_UINT64(100U + 1000U * 200U, stamp_at(1000U + 1000U * 200U));
    const uint64_t then_us = 1000U + 400U * 200U;
    TEST_ASSERT_TRUE(stamp_at(then_us) <= 100U + 400U * 200U);
    TEST_ASSERT_TRUE(stamp_at(then_us) + 2U * SERIAL_STAMP_US >= 100U + 400U * 200U);
}

TEST(test_link_goes_offline_once) {
    (void)receive_link(BOOT, 5, 1000);
    TEST_ASSERT_FALSE(serial_link_fell_silent(&state, 1000U + SERIAL_SILENT_US - 1U));
    TEST_ASSERT_TRUE(serial_link_fell_silent(&state, 1000U + SERIAL_SILENT_US));
    TEST_ASSERT_FALSE(serial_link_fell_silent(&state, 1000U + SERIAL_SILENT_US));
}

TEST(test_link_bad_lines_are_counted_and_change_nothing) {
    (void)receive_link(BOOT, 5, 1000);
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_NONE, receive_raw("1 6 {\"ok\":true}*00000000\n", 2000));
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_NONE, receive(1, 7, "{\"ok\":tru}", 2000));
    TEST_ASSERT_EQUAL_INT(SERIAL_NEWS_NONE, receive(0, 8, "{\"event\":\"link\",\"boot\":\"short\"}", 2000));
    TEST_ASSERT_EQUAL_UINT64(2, state.refused);
    TEST_ASSERT_EQUAL_STRING(BOOT, state.boot);
    (void)receive(0, 9, "{\"event\":\"line_error\",\"reason\":\"crc\",\"count\":3}", 2000);
    TEST_ASSERT_EQUAL_UINT64(3, state.complaints);
}

TEST(test_link_noise_is_counted_until_it_is_cleared) {
    (void)receive_raw("boot: ok\n\xff", 1000);
    TEST_ASSERT_EQUAL_UINT64(10, state.noise.bytes);
    TEST_ASSERT_EQUAL_UINT64(1, state.noise.odd);
    TEST_ASSERT_EQUAL_UINT64(1, state.noise.lines[IWN_LINE_UNCHECKED]);
    TEST_ASSERT_EQUAL_STRING("boot: ok", state.noise.sample);
    serial_link_forget_noise(&state);
    TEST_ASSERT_EQUAL_UINT64(0, state.noise.bytes + state.noise.odd + state.noise.lines[IWN_LINE_UNCHECKED]);
}
