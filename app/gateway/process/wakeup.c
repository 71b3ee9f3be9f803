// SPDX-License-Identifier: MIT
#include "wakeup.h"

#include <errno.h>
#include <stddef.h>
#include <sys/timerfd.h>
#include <unistd.h>

#define US_PER_S  1000000U
#define NS_PER_US 1000L

int gw_wakeup_open(gw_wakeup_t *self) {
    *self = (gw_wakeup_t){.fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC), .due_us = IW_NEVER};
    return (self->fd < 0) ? errno : 0;
}

void gw_wakeup_close(gw_wakeup_t *self) {
    (void)close(self->fd);
}

bool gw_wakeup_by(gw_wakeup_t *self, iw_time_us_t next_us) {
    if (next_us == 0U) {
        next_us = 1U; // 0 would disarm it.
    }
    if (self->due_us <= next_us && self->due_us != IW_NEVER) {
        return false;
    }
    self->due_us = next_us;
    const struct itimerspec when = {
        .it_value = {.tv_sec = (time_t)(next_us / US_PER_S), .tv_nsec = (long)(next_us % US_PER_S) * NS_PER_US}};
    (void)timerfd_settime(self->fd, TFD_TIMER_ABSTIME, &when, NULL);
    return true;
}

void gw_wakeup_came(gw_wakeup_t *self) {
    self->due_us = IW_NEVER;
}
