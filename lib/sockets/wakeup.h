// SPDX-License-Identifier: MIT
/// The wait of the loop, until a descriptor has something to tell or a time has come: one system call that carries the
/// deadline, precise to microseconds.
#ifndef GATEWAY_WAKEUP_H
#define GATEWAY_WAKEUP_H

#include "iwheel/types.h"

struct epoll_event;

typedef struct {
    int fd;         ///< The epoll set that is waited for.
    bool two_calls; ///< The kernel (before 5.11) has no wait with such a deadline: one call waits, a second one looks.
} sock_wakeup_t;

/// An epoll set with nothing in it yet. The process asks the kernel to be woken without slack, which is 50 us elsewhere.
/// 0, or an errno.
int sock_wakeup_open(sock_wakeup_t *self);
void sock_wakeup_close(sock_wakeup_t *self);

/// As epoll_wait, until this time of CLOCK_MONOTONIC, never sooner without an event: IW_NEVER waits for ever, one that is
/// past only looks. `now_us`: the time as read before, and it may be woken as much later as that is ago; 0: it is read, so that the
/// wait ends in time.
int sock_wakeup_wait(const sock_wakeup_t *self, struct epoll_event *events, int room, iw_time_us_t now_us,
                     iw_time_us_t until_us);

#endif
