// SPDX-License-Identifier: MIT
#include "wakeup.h"

#include "iwheel_linux/clock.h"

#include <errno.h>
#include <linux/time_types.h>
#include <poll.h>
#include <stddef.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#define US_PER_S  1000000U
#define NS_PER_US 1000L

#ifdef SYS_epoll_pwait2
#define WAIT_WITH_DEADLINE SYS_epoll_pwait2
#else
#define WAIT_WITH_DEADLINE 441 // The same number on all architectures; headers older than Linux 5.11 do not define it.
#endif

/// Not the function of the C library, which has one only since 2.35, and with 32 bits of time on some machines.
static int wait_with_deadline(int fd, struct epoll_event *events, int capacity, const struct __kernel_timespec *span) {
    return (int)syscall(WAIT_WITH_DEADLINE, fd, events, capacity, span, NULL, (size_t)0);
}

/// Returns true if the system call is missing: an old kernel returns ENOSYS, a filter that does not know the number
/// EPERM. The call itself returns neither.
static bool is_missing(int fd) {
    struct epoll_event event;
    const struct __kernel_timespec none = {0};
    return wait_with_deadline(fd, &event, 1, &none) < 0 && (errno == ENOSYS || errno == EPERM);
}

int sock_wakeup_open(sock_wakeup_t *self) {
    *self = (sock_wakeup_t){.fd = epoll_create1(EPOLL_CLOEXEC)};
    if (self->fd < 0) {
        return errno;
    }
    self->two_calls = is_missing(self->fd);
    (void)prctl(PR_SET_TIMERSLACK, 1UL);
    return 0;
}

void sock_wakeup_close(sock_wakeup_t *self) {
    (void)close(self->fd);
}

static int wait_by_two_calls(int fd, struct epoll_event *events, int capacity, const struct __kernel_timespec *span) {
    struct pollfd watched = {.fd = fd, .events = POLLIN};
    struct timespec same = {0};
    if (span != NULL) {
        same = (struct timespec){.tv_sec = (time_t)span->tv_sec, .tv_nsec = (long)span->tv_nsec};
    }
    return (ppoll(&watched, 1U, (span != NULL) ? &same : NULL, NULL) < 0) ? -1 : epoll_wait(fd, events, capacity, 0);
}

int sock_wakeup_wait(const sock_wakeup_t *self, struct epoll_event *events, int capacity, iw_time_us_t now_us,
                     iw_time_us_t until_us) {
    const bool known = now_us != 0U || until_us == 0U || until_us == IW_NEVER;
    const iw_time_us_t from_us = known ? now_us : iwl_clock_now_us();
    const iw_time_us_t span_us = (until_us > from_us) ? until_us - from_us : 0U;
    const struct __kernel_timespec span = {.tv_sec = (int64_t)(span_us / US_PER_S),
                                           .tv_nsec = (int64_t)(span_us % US_PER_S) * NS_PER_US};
    const struct __kernel_timespec *limit = (until_us == IW_NEVER) ? NULL : &span;
    return (self->two_calls ? wait_by_two_calls : wait_with_deadline)(self->fd, events, capacity, limit);
}
