// SPDX-License-Identifier: MIT
#include "notify.h"

#include "iwheel_linux/clock.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static uint64_t number_of(const char *variable) {
    const char *text = getenv(variable);
    return (text == NULL) ? 0U : strtoull(text, NULL, 10);
}

void gw_notify_open(gw_notify_t *self) {
    *self = (gw_notify_t){.address = {.sun_family = AF_UNIX}, .every_us = IW_NEVER, .fd = -1};
    self->fed_us = iwl_clock_now_us(); // The first message is READY=1.
    const char *path = getenv("NOTIFY_SOCKET");
    const size_t length = (path == NULL) ? 0U : strlen(path);
    if (length < 2U || length >= sizeof self->address.sun_path || (path[0] != '/' && path[0] != '@')) {
        return;
    }
    memcpy(self->address.sun_path, path, length);
    if (path[0] == '@') {
        self->address.sun_path[0] = '\0'; // Abstract address.
    }
    self->address_length = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
    self->fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const uint64_t limit_us = number_of("WATCHDOG_USEC");
    const uint64_t pid = number_of("WATCHDOG_PID");
    if (limit_us > 0U && (pid == 0U || pid == (uint64_t)getpid())) {
        self->every_us = limit_us / 2U;
    }
}

void gw_notify_close(gw_notify_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}

static void notify(const gw_notify_t *self, const char *words) {
    if (self->fd >= 0) {
        (void)sendto(self->fd, words, strlen(words), MSG_DONTWAIT | MSG_NOSIGNAL,
                     (const struct sockaddr *)&self->address, self->address_length);
    }
}

void gw_notify_ready(const gw_notify_t *self) {
    notify(self, "READY=1");
}

void gw_notify_stopping(const gw_notify_t *self) {
    notify(self, "STOPPING=1");
}

void gw_notify_cycle(gw_notify_t *self, iw_time_us_t now_us) {
    if (self->every_us != IW_NEVER && now_us - self->fed_us >= self->every_us) {
        self->fed_us = now_us;
        notify(self, "WATCHDOG=1");
    }
}
