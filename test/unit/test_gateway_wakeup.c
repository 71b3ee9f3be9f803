// SPDX-License-Identifier: MIT
#include "process/wakeup.h"

#include "iwheel_linux/clock.h"

#include <poll.h>
#include <unity.h>

#define SOON_US   20000U
#define LATER_US  3600000000U
#define PATIENCE  2000 // ms, for a machine that has much to do
#define AT_ONCE   0
#define LITTLE_ms 60 // three times SOON_US

static gw_wakeup_t wakeup;

void setUp(void) {
    TEST_ASSERT_EQUAL_INT(0, gw_wakeup_open(&wakeup));
}

void tearDown(void) {
    gw_wakeup_close(&wakeup);
}

static bool wakes_within(int ms) {
    struct pollfd watched = {.fd = wakeup.fd, .events = POLLIN};
    return poll(&watched, 1U, ms) == 1;
}

static iw_time_us_t in_us(iw_time_us_t span_us) {
    return iw_clock_now_us() + span_us;
}

static void test_wakes_at_its_time_and_not_before(void) {
    const iw_time_us_t due_us = in_us(SOON_US);
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, due_us));
    TEST_ASSERT_TRUE(wakes_within(PATIENCE));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT64(due_us, iw_clock_now_us());
}

static void test_time_that_is_past_wakes_at_once(void) {
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, 0U));
    TEST_ASSERT_TRUE(wakes_within(AT_ONCE));
}

static void test_later_wish_is_no_reason_to_set_it_anew(void) {
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, in_us(SOON_US)));
    TEST_ASSERT_FALSE(gw_wakeup_by(&wakeup, in_us(LATER_US)));
    TEST_ASSERT_FALSE(gw_wakeup_by(&wakeup, IW_NEVER));
    TEST_ASSERT_TRUE(wakes_within(PATIENCE));
}

static void test_same_wish_is_no_reason_to_set_it_anew(void) {
    const iw_time_us_t due_us = in_us(LATER_US);
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, due_us));
    TEST_ASSERT_FALSE(gw_wakeup_by(&wakeup, due_us));
}

static void test_sooner_wish_sets_it_anew(void) {
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, in_us(LATER_US)));
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, in_us(SOON_US)));
    TEST_ASSERT_TRUE(wakes_within(PATIENCE));
}

static void test_one_that_has_woken_is_set_anew_and_no_longer_tells(void) {
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, 0U));
    TEST_ASSERT_TRUE(wakes_within(AT_ONCE));
    gw_wakeup_came(&wakeup);
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, in_us(LATER_US)));
    TEST_ASSERT_FALSE(wakes_within(AT_ONCE));
}

static void test_without_a_wish_it_never_wakes(void) {
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, IW_NEVER));
    TEST_ASSERT_FALSE(wakes_within(LITTLE_ms));
    TEST_ASSERT_TRUE(gw_wakeup_by(&wakeup, in_us(SOON_US)));
    TEST_ASSERT_TRUE(wakes_within(PATIENCE));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_wakes_at_its_time_and_not_before);
    RUN_TEST(test_time_that_is_past_wakes_at_once);
    RUN_TEST(test_later_wish_is_no_reason_to_set_it_anew);
    RUN_TEST(test_same_wish_is_no_reason_to_set_it_anew);
    RUN_TEST(test_sooner_wish_sets_it_anew);
    RUN_TEST(test_one_that_has_woken_is_set_anew_and_no_longer_tells);
    RUN_TEST(test_without_a_wish_it_never_wakes);
    return UNITY_END();
}
