// SPDX-License-Identifier: MIT
#include "unix_link.h"

#include <errno.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static const char prefix[] = "unix:";

bool iwl_unix_link_is_name(const char *name) {
    return strncmp(name, prefix, sizeof prefix - 1U) == 0;
}

/// Non-blocking also while connecting: a hub that does not accept must not delay the loop.
static bool try_connect(iwl_unix_link_t *self) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    memcpy(address.sun_path, self->path, strlen(self->path) + 1U);
    const int fd = socket(AF_UNIX, self->type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return false;
    }
    struct epoll_event interest = {.events = EPOLLIN};
    if (connect(fd, (const struct sockaddr *)&address, sizeof address) != 0 ||
        epoll_ctl(self->watch_fd, EPOLL_CTL_ADD, fd, &interest) != 0) {
        (void)close(fd);
        return false;
    }
    self->fd = fd;
    self->retry_us = IW_NEVER;
    self->backoff_us = IWL_UNIX_LINK_RETRY_MIN_US;
    return true;
}

int iwl_unix_link_open(iwl_unix_link_t *self, const char *name, int type) {
    const char *path = name + sizeof prefix - 1U;
    if (*path == '\0') {
        return ENOENT;
    }
    if (strlen(path) >= sizeof((struct sockaddr_un *)NULL)->sun_path) {
        return ENAMETOOLONG;
    }
    const int watch_fd = epoll_create1(EPOLL_CLOEXEC);
    if (watch_fd < 0) {
        return errno;
    }
    // A missing listener is not an error: the simulator may start later.
    *self = (iwl_unix_link_t){.path = path,
                              .retry_us = 0,
                              .backoff_us = IWL_UNIX_LINK_RETRY_MIN_US,
                              .type = type,
                              .watch_fd = watch_fd,
                              .fd = -1};
    (void)try_connect(self);
    return 0;
}

void iwl_unix_link_close(iwl_unix_link_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    (void)close(self->watch_fd);
    self->fd = -1;
    self->watch_fd = -1;
}

bool iwl_unix_link_is_up(const iwl_unix_link_t *self) {
    return self->fd >= 0;
}

void iwl_unix_link_lose(iwl_unix_link_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
        self->retry_us = 0; // The first attempt is immediate; the back-off follows a failure.
    }
}

bool iwl_unix_link_poll(iwl_unix_link_t *self, iw_time_us_t now_us) {
    if (self->fd >= 0 || now_us < self->retry_us) {
        return false;
    }
    if (try_connect(self)) {
        return true;
    }
    self->retry_us = now_us + self->backoff_us;
    const uint32_t longer_us = self->backoff_us * 2U;
    self->backoff_us = (longer_us < IWL_UNIX_LINK_RETRY_MAX_US) ? longer_us : IWL_UNIX_LINK_RETRY_MAX_US;
    return false;
}
