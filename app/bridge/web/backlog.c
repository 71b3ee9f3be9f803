// SPDX-License-Identifier: MIT
#include "backlog.h"

#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/// Largest number of connections that one step accepts, so that other work does not wait.
#define AT_ONCE 64U

bool web_backlog_open(web_backlog_t *self, const int listen_fds[WEB_BACKLOG_LISTENERS]) {
    *self = (web_backlog_t){.epoll_fd = epoll_create1(EPOLL_CLOEXEC)};
    memcpy(self->listen_fds, listen_fds, sizeof self->listen_fds);
    if (self->epoll_fd < 0) {
        web_backlog_close(self);
        return false;
    }
    return true;
}

/// Removes a connection from the list: the library has the connection, or it is closed.
static void forget(web_backlog_t *self, unsigned at) {
    self->count--;
    memmove(&self->pending[at], &self->pending[at + 1U], (self->count - at) * sizeof self->pending[0]);
}

static void close_oldest(web_backlog_t *self) {
    (void)close(self->pending[0].fd); // This also removes it from the epoll set.
    forget(self, 0);
}

void web_backlog_close(web_backlog_t *self) {
    while (self->count > 0U) {
        close_oldest(self);
    }
    for (unsigned i = 0; i < WEB_BACKLOG_LISTENERS; i++) {
        if (self->listen_fds[i] >= 0) {
            (void)close(self->listen_fds[i]);
        }
    }
    if (self->epoll_fd >= 0) {
        (void)close(self->epoll_fd);
    }
    *self = (web_backlog_t){.listen_fds = {-1, -1}, .epoll_fd = -1};
}

static bool has_room(const web_backlog_t *self, uint64_t now_us) {
    return self->count < WEB_BACKLOG_MAX || now_us - self->pending[0].since_us >= WEB_BACKLOG_GRACE_US;
}

static void accept_new(web_backlog_t *self, int listen_fd, uint64_t now_us) {
    for (unsigned i = 0; i < AT_ONCE && listen_fd >= 0 && has_room(self, now_us); i++) {
        const int fd = accept4(listen_fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
        struct epoll_event event = {.events = EPOLLIN | EPOLLRDHUP, .data.fd = fd};
        if (fd < 0) {
            return;
        }
        if (epoll_ctl(self->epoll_fd, EPOLL_CTL_ADD, fd, &event) != 0) {
            (void)close(fd);
            continue;
        }
        if (self->count == WEB_BACKLOG_MAX) {
            close_oldest(self);
            self->crowded_out++;
        }
        self->pending[self->count++] = (web_pending_t){fd, now_us};
    }
}

void web_backlog_step(web_backlog_t *self, uint64_t now_us) {
    while (self->count > 0U && now_us - self->pending[0].since_us >= WEB_BACKLOG_US) {
        close_oldest(self);
    }
    for (unsigned i = 0; i < WEB_BACKLOG_LISTENERS; i++) {
        accept_new(self, self->listen_fds[i], now_us);
    }
}

int web_backlog_take(web_backlog_t *self) {
    struct epoll_event event;
    if (epoll_wait(self->epoll_fd, &event, 1, 0) != 1) {
        return -1;
    }
    const int fd = event.data.fd;
    (void)epoll_ctl(self->epoll_fd, EPOLL_CTL_DEL, fd, NULL);
    for (unsigned i = 0; i < self->count; i++) {
        if (self->pending[i].fd == fd) {
            forget(self, i);
            break;
        }
    }
    return fd;
}

int web_backlog_fd(const web_backlog_t *self, unsigned listener, uint64_t now_us) {
    return has_room(self, now_us) ? self->listen_fds[listener] : -1;
}

uint64_t web_backlog_next_us(const web_backlog_t *self, uint64_t now_us) {
    if (self->count == 0U) {
        return UINT64_MAX;
    }
    return self->pending[0].since_us + (has_room(self, now_us) ? WEB_BACKLOG_US : WEB_BACKLOG_GRACE_US);
}
