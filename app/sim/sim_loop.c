// SPDX-License-Identifier: MIT
#include "sim_loop.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define EVENTS_MAX 32
#define US_PER_S   1000000U
#define BACKLOG    16

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

static bool fill_address(struct sockaddr_un *address, const char *path) {
    size_t const length = strlen(path);
    *address = (struct sockaddr_un){.sun_family = AF_UNIX};
    if (length == 0U || length >= sizeof address->sun_path) {
        errno = ENAMETOOLONG;
        return false;
    }
    memcpy(address->sun_path, path, length);
    return true;
}

int sim_listener_connect(const char *path, int type) {
    struct sockaddr_un address;
    if (!fill_address(&address, path)) {
        return -1;
    }
    int const fd = socket(AF_UNIX, type | SOCK_CLOEXEC, 0);
    if (fd >= 0 && connect(fd, (struct sockaddr *)&address, sizeof address) != 0) {
        int const saved = errno;
        (void)close(fd);
        errno = saved;
        return -1;
    }
    return fd;
}

static bool refuse(sim_reason_t *out_reason, const char *path, const char *why) {
    (void)snprintf(out_reason->text, sizeof out_reason->text, "%.120s: %s", path, why);
    return false;
}

/// Makes `path` free: there is no file, or only a socket without a listener, which is removed.
static bool make_room(const char *path, int type, sim_reason_t *out_reason) {
    struct stat there;
    if (lstat(path, &there) != 0) {
        return errno == ENOENT || refuse(out_reason, path, strerror(errno));
    }
    if (!S_ISSOCK(there.st_mode)) {
        return refuse(out_reason, path, "exists and is not a socket; remove it or choose another path");
    }
    int const fd = sim_listener_connect(path, type);
    if (fd >= 0 || errno != ECONNREFUSED) {
        if (fd >= 0) {
            (void)close(fd);
        }
        return refuse(out_reason, path,
                      "another process listens there; end the other iwheel-sim or choose another path");
    }
    return unlink(path) == 0 || refuse(out_reason, path, strerror(errno));
}

static void accept_watcher(sim_watch_t *watch) {
    sim_listener_t *const self = watch->owner;
    const int fd = (watch->fd >= 0) ? accept4(watch->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC) : -1;
    if (fd >= 0 && !self->admit(self->owner, fd)) {
        (void)close(fd);
    }
}

/// Returns a socket that listens at the address, and in `*out_made` the status of its file; -1 with errno on failure.
static int listen_at(const struct sockaddr_un *address, int type, struct stat *out_made) {
    const char *path = address->sun_path;
    const int fd = socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) {
        return -1;
    }
    if (bind(fd, (const struct sockaddr *)address, sizeof *address) != 0 || chmod(path, 0660) != 0 ||
        lstat(path, out_made) != 0 || listen(fd, BACKLOG) != 0) {
        const int error = errno;
        (void)close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

bool sim_listener_open(sim_listener_t *self, const char *path, int type, sim_reason_t *out_reason) {
    struct sockaddr_un address;
    struct stat made = {0};
    self->watch = (sim_watch_t){accept_watcher, self, -1};
    if (!fill_address(&address, path)) {
        return refuse(out_reason, path, "the path of a unix socket has 1 to 107 characters; choose a shorter one");
    }
    if (!make_room(path, type, out_reason)) {
        return false;
    }
    const int fd = listen_at(&address, type, &made);
    if (fd < 0) {
        return refuse(out_reason, path, strerror(errno));
    }
    self->device = made.st_dev;
    self->inode = made.st_ino;
    memcpy(self->path, address.sun_path, sizeof self->path);
    self->watch.fd = fd;
    if (!sim_loop_add(self->loop, &self->watch)) {
        (void)refuse(out_reason, path, strerror(errno));
        (void)close(fd);
        self->watch.fd = -1;
        return false;
    }
    return true;
}

void sim_listener_close(sim_listener_t *self) {
    struct stat there;
    if (self->watch.fd < 0) {
        return;
    }
    sim_loop_drop(self->loop, &self->watch);
    if (lstat(self->path, &there) == 0 && there.st_dev == self->device && there.st_ino == self->inode) {
        (void)unlink(self->path);
    }
}
