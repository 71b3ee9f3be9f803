// SPDX-License-Identifier: MIT
#include "door.h"

#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/// Largest number of connections that one step accepts, so that other work does not wait.
#define AT_ONCE 64U

bool web_door_open(web_door_t *self, const int listen_fds[WEB_DOOR_LISTENERS]) {
    *self = (web_door_t){.epoll_fd = epoll_create1(EPOLL_CLOEXEC)};
    memcpy(self->listen_fds, listen_fds, sizeof self->listen_fds);
    if (self->epoll_fd < 0) {
        web_door_close(self);
        return false;
    }
    return true;
}

/// Removes a guest from the list: the library has the connection, or it is closed.
static void forget(web_door_t *self, unsigned at) {
    self->count--;
    memmove(&self->guests[at], &self->guests[at + 1U], (self->count - at) * sizeof self->guests[0]);
}

static void show_out_oldest(web_door_t *self) {
    (void)close(self->guests[0].fd); // This also removes it from the epoll set.
    forget(self, 0);
}

void web_door_close(web_door_t *self) {
    while (self->count > 0U) {
        show_out_oldest(self);
    }
    for (unsigned i = 0; i < WEB_DOOR_LISTENERS; i++) {
        if (self->listen_fds[i] >= 0) {
            (void)close(self->listen_fds[i]);
        }
    }
    if (self->epoll_fd >= 0) {
        (void)close(self->epoll_fd);
    }
    *self = (web_door_t){.listen_fds = {-1, -1}, .epoll_fd = -1};
}

static bool has_room(const web_door_t *self, uint64_t now_us) {
    return self->count < WEB_DOOR_MAX || now_us - self->guests[0].since_us >= WEB_DOOR_GRACE_US;
}

static void let_in(web_door_t *self, int listen_fd, uint64_t now_us) {
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
        if (self->count == WEB_DOOR_MAX) {
            show_out_oldest(self);
            self->crowded_out++;
        }
        self->guests[self->count++] = (web_guest_t){fd, now_us};
    }
}

void web_door_step(web_door_t *self, uint64_t now_us) {
    while (self->count > 0U && now_us - self->guests[0].since_us >= WEB_DOOR_US) {
        show_out_oldest(self);
    }
    for (unsigned i = 0; i < WEB_DOOR_LISTENERS; i++) {
        let_in(self, self->listen_fds[i], now_us);
    }
}

int web_door_take(web_door_t *self) {
    struct epoll_event event;
    if (epoll_wait(self->epoll_fd, &event, 1, 0) != 1) {
        return -1;
    }
    const int fd = event.data.fd;
    (void)epoll_ctl(self->epoll_fd, EPOLL_CTL_DEL, fd, NULL);
    for (unsigned i = 0; i < self->count; i++) {
        if (self->guests[i].fd == fd) {
            forget(self, i);
            break;
        }
    }
    return fd;
}

int web_door_fd(const web_door_t *self, unsigned listener, uint64_t now_us) {
    return has_room(self, now_us) ? self->listen_fds[listener] : -1;
}

uint64_t web_door_next_us(const web_door_t *self, uint64_t now_us) {
    if (self->count == 0U) {
        return UINT64_MAX;
    }
    return self->guests[0].since_us + (has_room(self, now_us) ? WEB_DOOR_US : WEB_DOOR_GRACE_US);
}
