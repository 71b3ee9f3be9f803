// SPDX-License-Identifier: MIT
#include "log.h"

#include "iwheel_linux/clock.h"
#include "iwheel_northbound/text.h"

#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#define BURST_LINES 40U
#define LINE_US     200000U
#define LINE_SIZE   1024U

static const char *const level_names[SOCK_LOG_LEVELS] = {"error", "warning", "info", "debug"};

void sock_log_open(sock_log_t *self, sock_log_level_t level) {
    struct stat status;
    *self = (sock_log_t){
        .program = "iwheel-gateway", .credit_us = iwl_clock_now_us(), .credit = BURST_LINES, .level = level};
    self->socket = fstat(STDERR_FILENO, &status) == 0 && S_ISSOCK(status.st_mode);
    self->fd = open("/proc/self/fd/2", O_WRONLY | O_APPEND | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (self->fd < 0) {
        self->fd = STDERR_FILENO;
    }
}

void sock_log_close(sock_log_t *self) {
    if (self->fd != STDERR_FILENO) {
        (void)close(self->fd);
        self->fd = STDERR_FILENO;
    }
}

/// Writes the line. Returns true if all of it was written.
static bool put_line(const sock_log_t *self, const char *line, size_t length) {
    struct pollfd ready = {.fd = self->fd, .events = POLLOUT};
    if (self->socket) {
        return send(STDERR_FILENO, line, length, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)length;
    }
    return poll(&ready, 1, 0) == 1 && (ready.revents & POLLOUT) != 0 &&
           write(self->fd, line, length) == (ssize_t)length;
}

static void earn_credit(sock_log_t *self) {
    const iw_time_us_t now_us = iwl_clock_now_us();
    const uint64_t earned = (now_us - self->credit_us) / LINE_US;
    if (earned > 0U) {
        self->credit = (earned + self->credit > BURST_LINES) ? BURST_LINES : self->credit + (uint32_t)earned;
        self->credit_us += earned * LINE_US;
    }
}

void sock_log(sock_log_t *self, sock_log_level_t level, const char *format, ...) {
    char raw[LINE_SIZE];
    char line[LINE_SIZE];
    if (level > self->level) {
        return;
    }
    earn_credit(self);
    if (self->credit == 0U) {
        self->dropped++;
        return;
    }
    int length = snprintf(raw, sizeof raw, "%s: %s: ", self->program, level_names[level]);
    if (self->dropped > 0U) {
        length += snprintf(&raw[length], sizeof raw - (size_t)length, "(%u lines dropped before this one) ",
                           (unsigned)self->dropped);
    }
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(&raw[length], sizeof raw - (size_t)length, format, arguments);
    va_end(arguments);
    iwn_plain_copy(raw, line, sizeof line - 1U); // The text may be cut anywhere, and has names from other programs.
    const size_t end = strlen(line);
    line[end] = '\n';
    self->credit--;
    self->dropped = put_line(self, line, end + 1U) ? 0U : self->dropped + 1U;
}

bool sock_log_level_of(const char *word, sock_log_level_t *out_level) {
    for (unsigned i = 0; i < SOCK_LOG_LEVELS; i++) {
        if (strcmp(word, level_names[i]) == 0) {
            *out_level = (sock_log_level_t)i;
            return true;
        }
    }
    return false;
}
