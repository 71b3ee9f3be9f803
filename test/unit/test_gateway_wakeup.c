// SPDX-License-Identifier: MIT
#include "sockets/wakeup.h"

#include "iwheel_linux/clock.h"

#include "unit.h"
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#define SOON_US  20000U
#define LATER_US 3600000000U
#define TAG      7U
#define MAX      4

static sock_wakeup_t wakeup;
static bool asks_only; // A long wait stores its time and does not wait.
static struct timespec asked_for;
static int event_fd;

void setUp(void) {
    struct epoll_event interest = {.events = EPOLLIN, .data = {.u64 = TAG}};
    TEST_ASSERT_EQUAL_INT(0, sock_wakeup_open(&wakeup));
    event_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    TEST_ASSERT_EQUAL_INT(0, epoll_ctl(wakeup.fd, EPOLL_CTL_ADD, event_fd, &interest));
}

void tearDown(void) {
    sock_wakeup_close(&wakeup);
    (void)close(event_fd);
}

static int wait_until(iw_time_us_t until_us) {
    struct epoll_event events[MAX];
    const int count = sock_wakeup_wait(&wakeup, events, MAX, 0U, until_us);
    if (count == 1) {
        TEST_ASSERT_EQUAL_UINT64(TAG, events[0].data.u64);
    }
    return count;
}

static iw_time_us_t in_us(iw_time_us_t span_us) {
    return iwl_clock_now_us() + span_us;
}

/// Replaces the function of the C library. It waits, or stores the time only.
int ppoll(struct pollfd *watched, nfds_t count, const struct timespec *span, const sigset_t *mask) {
    (void)mask;
    TEST_ASSERT_EQUAL_UINT(1U, (unsigned)count);
    if (!asks_only) {
        return poll(watched, count,
                    (span == NULL) ? -1 : (int)(span->tv_sec * 1000 + (span->tv_nsec + 999999) / 1000000));
    }
    asked_for = *span;
    return 0;
}

static void check_wakes_at_its_time_and_not_before(void) {
    const iw_time_us_t due_us = in_us(SOON_US);
    TEST_ASSERT_EQUAL_INT(0, wait_until(due_us));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT64(due_us, iwl_clock_now_us());
}

static void check_time_that_was_read_before_is_not_read_again(void) {
    struct epoll_event events[MAX];
    const iw_time_us_t due_us = in_us(SOON_US);
    TEST_ASSERT_EQUAL_INT(0, sock_wakeup_wait(&wakeup, events, MAX, LATER_US, LATER_US + SOON_US));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT64(due_us, iwl_clock_now_us());
}

static void check_time_that_is_past_only_polls(void) {
    TEST_ASSERT_EQUAL_INT(0, wait_until(0U));
    TEST_ASSERT_EQUAL_INT(0, wait_until(1U));
}

static void check_event_wakes_before_any_time(void) {
    TEST_ASSERT_EQUAL_INT(0, eventfd_write(event_fd, 1U));
    TEST_ASSERT_EQUAL_INT(1, wait_until(0U));
    TEST_ASSERT_EQUAL_INT(1, wait_until(in_us(LATER_US)));
    TEST_ASSERT_EQUAL_INT(1, wait_until(IW_NEVER));
}

TEST(test_wakeup_is_not_before_its_time) {
    check_wakes_at_its_time_and_not_before();
}

TEST(test_wakeup_uses_the_requested_time) {
    check_time_that_was_read_before_is_not_read_again();
}

TEST(test_wakeup_with_a_past_time_only_polls) {
    check_time_that_is_past_only_polls();
}

TEST(test_wakeup_by_an_event_is_immediate) {
    check_event_wakes_before_any_time();
}

TEST(test_wakeup_on_an_old_kernel_uses_two_calls) {
    wakeup.two_calls = true;
    check_wakes_at_its_time_and_not_before();
    check_time_that_was_read_before_is_not_read_again();
    check_time_that_is_past_only_polls();
    check_event_wakes_before_any_time();
}

TEST(test_wakeup_of_seconds_has_seconds_and_nanoseconds) {
    wakeup.two_calls = true;
    asks_only = true;
    struct epoll_event events[MAX]; // Both times are given, so no clock is read.
    TEST_ASSERT_EQUAL_INT(0, sock_wakeup_wait(&wakeup, events, MAX, SOON_US, SOON_US + 7800000U));
    asks_only = false;
    TEST_ASSERT_EQUAL_INT(7, (int)asked_for.tv_sec);
    TEST_ASSERT_EQUAL_INT(800000000, (int)asked_for.tv_nsec);
}
