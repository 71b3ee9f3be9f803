// SPDX-License-Identifier: MIT
#include "bridge_service.h"

#include <fcntl.h>
#include <signal.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

static volatile sig_atomic_t end_asked;

static void ask_end(int number) {
    (void)number;
    end_asked = 1;
}

static int64_t read_us(clockid_t clock) {
    struct timespec now = {0};
    (void)clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

uint64_t bridge_now_us(void) {
    return (uint64_t)read_us(CLOCK_MONOTONIC);
}

int64_t bridge_wall_us(void) {
    return read_us(CLOCK_REALTIME);
}

void bridge_service_take_signals(void) {
    struct sigaction action = {.sa_handler = ask_end};
    sigset_t ours;
    (void)sigemptyset(&ours);
    (void)sigaddset(&ours, SIGTERM);
    (void)sigaddset(&ours, SIGINT);
    (void)sigprocmask(SIG_BLOCK, &ours, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGINT, &action, NULL);
    (void)signal(SIGPIPE, SIG_IGN);
}

bool bridge_service_wait(struct pollfd *fds, unsigned count, int wait_ms) {
    const struct timespec wait = {wait_ms / 1000, (long)(wait_ms % 1000) * 1000000L};
    sigset_t none;
    (void)sigemptyset(&none);
    if (end_asked == 0) {
        (void)ppoll(fds, count, (wait_ms >= 0) ? &wait : NULL, &none);
    }
    return end_asked == 0;
}

/// A terminal, a pipe or a device gets a description of its own, so that O_NONBLOCK affects no other process. A socket
/// has only the common one. A file never waits, and shares its position with stdout.
static void log_without_waiting(void) {
    struct stat status;
    if (fstat(STDERR_FILENO, &status) != 0 || S_ISREG(status.st_mode)) {
        return;
    }
    if (S_ISSOCK(status.st_mode)) {
        (void)fcntl(STDERR_FILENO, F_SETFL, fcntl(STDERR_FILENO, F_GETFL) | O_NONBLOCK);
        return;
    }
    const int own = open("/proc/self/fd/2", O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (own >= 0) {
        (void)dup2(own, STDERR_FILENO);
        (void)close(own);
    }
}

void bridge_service_open(bridge_service_t *self) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const char *path = getenv("NOTIFY_SOCKET");
    const char *limit = getenv("WATCHDOG_USEC");
    const size_t length = (path != NULL) ? strlen(path) : 0U;
    *self = (bridge_service_t){.fd = -1};
    log_without_waiting();
    if (length < 2U || length >= sizeof address.sun_path || (path[0] != '/' && path[0] != '@')) {
        return;
    }
    memcpy(address.sun_path, path, length);
    address.sun_path[0] = (path[0] == '@') ? '\0' : '/'; // Abstract names begin with a NUL.
    self->fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
    if (self->fd >= 0 && connect(self->fd, (const struct sockaddr *)&address, size) != 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
    self->every_us = (limit != NULL) ? strtoull(limit, NULL, 10) / 2U : 0U;
}

void bridge_service_notify(const bridge_service_t *self, const char *words) {
    if (self->fd >= 0) {
        (void)send(self->fd, words, strlen(words), MSG_DONTWAIT | MSG_NOSIGNAL);
    }
}

void bridge_service_round(bridge_service_t *self, uint64_t now_us) {
    if (self->every_us > 0U && now_us - self->fed_us >= self->every_us) {
        self->fed_us = now_us;
        bridge_service_notify(self, "WATCHDOG=1");
    }
}
