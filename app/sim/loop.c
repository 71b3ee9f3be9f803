// SPDX-License-Identifier: MIT
#include "loop.h"

#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define EVENTS_MAX 32
#define US_PER_S   1000000U

iw_time_us_t sim_loop_clock_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (iw_time_us_t)now.tv_sec * US_PER_S + (iw_time_us_t)now.tv_nsec / 1000U;
}

bool sim_loop_open(sim_loop_t *self) {
    self->epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    self->timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    if (self->epoll_fd < 0 || self->timer_fd < 0) {
        return false;
    }
    struct epoll_event event = {.events = EPOLLIN, .data.ptr = NULL};
    return epoll_ctl(self->epoll_fd, EPOLL_CTL_ADD, self->timer_fd, &event) == 0;
}

bool sim_loop_add(const sim_loop_t *self, sim_watch_t *watch) {
    struct epoll_event event = {.events = EPOLLIN, .data.ptr = watch};
    return epoll_ctl(self->epoll_fd, EPOLL_CTL_ADD, watch->fd, &event) == 0;
}

void sim_loop_remove(const sim_loop_t *self, const sim_watch_t *watch) {
    (void)epoll_ctl(self->epoll_fd, EPOLL_CTL_DEL, watch->fd, NULL);
}

void sim_loop_drop(const sim_loop_t *self, sim_watch_t *watch) {
    sim_loop_remove(self, watch);
    (void)close(watch->fd);
    watch->fd = -1;
}

static void set_timer(const sim_loop_t *self, iw_time_us_t wake_us) {
    struct itimerspec at = {0};
    if (wake_us != IW_NEVER) {
        at.it_value.tv_sec = (time_t)(wake_us / US_PER_S);
        at.it_value.tv_nsec = (long)(wake_us % US_PER_S) * 1000;
    }
    (void)timerfd_settime(self->timer_fd, TFD_TIMER_ABSTIME, &at, NULL);
}

void sim_loop_wait(const sim_loop_t *self, iw_time_us_t wake_us, void (*before)(void *context), void *context) {
    struct epoll_event event[EVENTS_MAX];
    set_timer(self, wake_us);
    int const count = epoll_wait(self->epoll_fd, event, EVENTS_MAX, -1);
    before(context);
    for (int i = 0; i < count; i++) {
        sim_watch_t *const watch = event[i].data.ptr;
        if (watch != NULL) {
            watch->ready(watch);
        }
    }
}
