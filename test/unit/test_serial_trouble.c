// SPDX-License-Identifier: MIT
// The reason why no board answers: which reason, how soon it follows a change, and how often it is logged.
#include "serial_trouble.h"

#include "unit.h"

#include <string.h>

#define WINDOW SERIAL_TROUBLE_US
#define HOUR   (UINT64_C(3600) * 1000000U)

static const serial_noise_t nothing;
static const serial_noise_t binary = {.bytes = 80, .odd = 11};
static const serial_noise_t text = {.bytes = 80, .odd = 10, .lines = {[IWN_LINE_UNCHECKED] = 1}, .sample = "login:"};
static const serial_place_t place = {"/dev/x", 115200};

static serial_trouble_t trouble;
static uint64_t now_us;

void setUp(void) {
    memset(&trouble, 0, sizeof trouble);
    now_us = 1000;
    serial_trouble_begin(&trouble, now_us);
}

/// Ends a window with this noise.
static serial_report_t window(const serial_noise_t *noise) {
    TEST_ASSERT_EQUAL_UINT64(now_us + WINDOW, trouble.judge_us);
    now_us = trouble.judge_us;
    return serial_trouble_judge(&trouble, noise, now_us);
}

static void explains(const serial_noise_t *noise, const char *words) {
    char out[512];
    setUp();
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(noise));
    serial_trouble_write(noise, &place, out, sizeof out);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(out, words), out);
}

TEST(test_trouble_reason_follows_from_the_noise) {
    explains(&nothing, "nothing comes from /dev/x: ");
    explains(&binary, "80 bytes came from /dev/x that are not text: the baud rate is not 115200");
    explains(&text, "/dev/x uses another protocol (such as \"login:\")");
    explains(&(serial_noise_t){.bytes = 9, .lines = {[IWN_LINE_MISFORMED] = 1}}, "another protocol");
    explains(&(serial_noise_t){.bytes = 9, .lines = {[IWN_LINE_CORRUPT] = 3, [IWN_LINE_UNCHECKED] = 1}},
             "damaged from /dev/x (3 with a wrong CRC)");
    explains(&(serial_noise_t){.bytes = 9, .lines = {[IWN_LINE_LOST] = 1}}, "damaged");
    explains(&(serial_noise_t){.bytes = 9}, "9 bytes came from /dev/x and no whole line");
}

TEST(test_trouble_of_another_kind_is_logged_after_its_window) {
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&nothing));
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&binary));
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&text));
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&binary));
    TEST_ASSERT_EQUAL_INT(SERIAL_TROUBLE_BAUD, trouble.kind);
}

TEST(test_trouble_of_the_same_kind_is_logged_once_per_interval) {
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&text));
    for (unsigned i = 1; i < SERIAL_TROUBLE_AGAIN_US / WINDOW; i++) {
        TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_CLIENTS, window(&text));
    }
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&text));
}

TEST(test_trouble_without_bytes_is_logged_once) {
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&nothing));
    for (unsigned i = 0; i < 2U * SERIAL_TROUBLE_AGAIN_US / WINDOW; i++) {
        TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_CLIENTS, window(&nothing));
    }
}

TEST(test_trouble_of_a_pausing_device_is_retained) {
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&text));
    for (unsigned i = 1; i < SERIAL_TROUBLE_PAUSE_US / WINDOW; i++) {
        TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_KEEP, window(&nothing));
        TEST_ASSERT_EQUAL_INT(SERIAL_TROUBLE_PROTOCOL, trouble.kind);
    }
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&nothing));
    TEST_ASSERT_EQUAL_INT(SERIAL_TROUBLE_NO_BYTES, trouble.kind);
}

/// Clients get each change. The log gets a burst of changes, and then one for each refill.
TEST(test_trouble_that_alternates_is_logged_at_a_limited_rate) {
    unsigned logged = 0;
    for (unsigned i = 0; i < HOUR / WINDOW; i++) {
        const serial_report_t report = window((i % 2U == 0U) ? &text : &binary);
        TEST_ASSERT_EQUAL_INT((i % 2U == 0U) ? SERIAL_TROUBLE_PROTOCOL : SERIAL_TROUBLE_BAUD, trouble.kind);
        TEST_ASSERT_TRUE((i < SERIAL_TROUBLE_BURST) ? report == SERIAL_REPORT_LOG : report != SERIAL_REPORT_KEEP);
        logged += (report == SERIAL_REPORT_LOG) ? 1U : 0U;
    }
    TEST_ASSERT_UINT_WITHIN(1, SERIAL_TROUBLE_BURST + HOUR / SERIAL_TROUBLE_REFILL_US, logged);
    for (unsigned i = 0; i < SERIAL_TROUBLE_BURST * (uint64_t)SERIAL_TROUBLE_REFILL_US / WINDOW; i++) {
        (void)window(&nothing);
    }
    for (unsigned i = 0; i < SERIAL_TROUBLE_BURST; i++) {
        TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window((i % 2U == 0U) ? &text : &binary));
    }
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_CLIENTS, window(&text));
}

/// A change that was not logged because the burst was used up is logged later, if it still holds.
TEST(test_trouble_beyond_the_burst_is_logged_later) {
    for (unsigned i = 0; i < SERIAL_TROUBLE_BURST; i++) {
        TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window((i % 2U == 0U) ? &text : &binary));
    }
    const uint64_t begin_us = now_us;
    while (window(&text) != SERIAL_REPORT_LOG) {
        TEST_ASSERT_TRUE(now_us < begin_us + SERIAL_TROUBLE_REFILL_US + WINDOW);
    }
    TEST_ASSERT_TRUE(now_us > begin_us + WINDOW);
}

TEST(test_trouble_restarts_with_each_opening_of_the_port) {
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&text));
    serial_trouble_begin(&trouble, now_us);
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&nothing)); // No pause is needed: the port was opened again.
    serial_trouble_begin(&trouble, now_us);
    TEST_ASSERT_EQUAL_INT(SERIAL_REPORT_LOG, window(&nothing));
}
