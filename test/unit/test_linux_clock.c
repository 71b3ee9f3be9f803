// SPDX-License-Identifier: MIT
// Roles of the kernel clocks: the wall clock may be set, and the clock that counts suspend time is not that of the
// loop.
#include "iwheel_linux/clock.h"

#include "unit.h"

#include <time.h>

/// Values of the kernel clocks, and the time that passes in each call.
static struct timespec monotonic;
static struct timespec boot;
static struct timespec wall;
static long passes_ns;

int clock_gettime(clockid_t clock, struct timespec *out_now) {
    *out_now = (clock == CLOCK_MONOTONIC) ? monotonic : (clock == CLOCK_BOOTTIME) ? boot : wall;
    monotonic.tv_nsec += passes_ns;
    boot.tv_nsec += passes_ns;
    return 0;
}

void setUp(void) {
    monotonic = (struct timespec){5000, 123456789};
    boot = (struct timespec){5000, 123456789};
    wall = (struct timespec){1700000000, 987654321};
    passes_ns = 0;
}

TEST(test_clock_of_the_loop_is_monotonic_in_microseconds) {
    TEST_ASSERT_EQUAL_UINT64(5000123456U, iwl_clock_now_us());
    wall.tv_sec -= 3600;
    boot.tv_sec += 60;
    TEST_ASSERT_EQUAL_UINT64(5000123456U, iwl_clock_now_us());
    iw_time_us_t suspended_us = 0;
    TEST_ASSERT_EQUAL_UINT64(5000123456U, iwl_clock_read(&suspended_us));
}

TEST(test_clock_reports_suspend_time_that_the_loop_does_not_count) {
    iw_time_us_t suspended_us = 1;
    (void)iwl_clock_read(&suspended_us);
    TEST_ASSERT_EQUAL_UINT64(0, suspended_us);
    boot.tv_sec += 2;
    (void)iwl_clock_read(&suspended_us);
    TEST_ASSERT_EQUAL_UINT64(2000000, suspended_us);
    TEST_ASSERT_EQUAL_UINT64(2000000, iwl_clock_suspended_us());
    wall.tv_sec += 3600;
    TEST_ASSERT_EQUAL_UINT64(2000000, iwl_clock_suspended_us());
}

TEST(test_clock_time_between_two_readings_is_no_suspend_time) {
    iw_time_us_t suspended_us = 1;
    passes_ns = 40000000;
    (void)iwl_clock_read(&suspended_us);
    TEST_ASSERT_EQUAL_UINT64(0, suspended_us);
    boot.tv_sec += 2;
    (void)iwl_clock_read(&suspended_us);
    TEST_ASSERT_TRUE(suspended_us <= 2000000U);
}

TEST(test_clock_awake_adds_only_suspend_time_not_yet_counted) {
    TEST_ASSERT_EQUAL_UINT64(iwl_clock_now_us(), iwl_clock_awake_us(0));
    boot.tv_sec += 2;
    wall.tv_sec += 3600;
    TEST_ASSERT_EQUAL_UINT64(iwl_clock_now_us() + 2000000U, iwl_clock_awake_us(0));
    TEST_ASSERT_EQUAL_UINT64(iwl_clock_now_us(), iwl_clock_awake_us(2000000U));
}

TEST(test_clock_wall_time_is_in_microseconds) {
    TEST_ASSERT_EQUAL_INT64(1700000000987654, iwl_clock_wall_us());
}
