// SPDX-License-Identifier: MIT
/// Wait of the loop until a descriptor is ready or a time has come: one system call with the deadline, precise to
/// microseconds.
#ifndef GATEWAY_WAKEUP_H
#define GATEWAY_WAKEUP_H

#include "iwheel/types.h"

struct epoll_event;

typedef struct {
    int fd;         ///< The epoll set.
    bool two_calls; ///< The kernel (before 5.11) has no wait with such a deadline: one call waits, a second one polls.
} sock_wakeup_t;

/// Creates an empty epoll set. The process asks the kernel for wake-ups without slack, which is 50 us by default.
/// Returns 0 or an errno.
int sock_wakeup_open(sock_wakeup_t *self);
void sock_wakeup_close(sock_wakeup_t *self);

/// Waits like epoll_wait until this time of CLOCK_MONOTONIC, and never returns earlier without an event. IW_NEVER waits
/// without limit; a time in the past only polls. `now_us`: the time that the caller read last; the wait may end later
/// by the age of that reading. With 0 the function reads the time, so that the wait ends in time.
int sock_wakeup_wait(const sock_wakeup_t *self, struct epoll_event *events, int capacity, iw_time_us_t now_us,
                     iw_time_us_t until_us);

#endif
