// SPDX-License-Identifier: MIT
#include "bus_log.h"

#include "candump.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define LINE_MAX_BYTES 320U
#define US_PER_S       1000000U

bool sim_bus_log_open(sim_bus_log_t *self, const char *path, bool write_direction) {
    self->oldest_us = IW_NEVER;
    self->used = 0U;
    self->fd = -1;
    self->write_direction = write_direction;
    if (path == NULL) {
        return true;
    }
    self->fd = (strcmp(path, "-") == 0) ? STDOUT_FILENO : open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    return self->fd >= 0;
}

void sim_bus_log_flush(sim_bus_log_t *self) {
    size_t done = 0U;
    while (done < self->used && self->fd >= 0) {
        ssize_t const written = write(self->fd, &self->buffer[done], self->used - done);
        if (written > 0) {
            done += (size_t)written;
        } else if (errno != EINTR) {
            (void)fprintf(stderr, "iwheel-sim: the log ends here, because it cannot be written: %s\n", strerror(errno));
            self->fd = -1;
        }
    }
    self->used = 0U;
    self->oldest_us = IW_NEVER;
}

iw_time_us_t sim_bus_log_step(sim_bus_log_t *self, iw_time_us_t now_us) {
    if (self->oldest_us == IW_NEVER) {
        return IW_NEVER;
    }
    if (now_us < self->oldest_us + SIM_LOG_HOLD_US) {
        return self->oldest_us + SIM_LOG_HOLD_US;
    }
    sim_bus_log_flush(self);
    return IW_NEVER;
}

static void append(sim_bus_log_t *self, iw_time_us_t at_us, const char *line, size_t length) {
    if (self->used + length > sizeof self->buffer) {
        sim_bus_log_flush(self);
    }
    memcpy(&self->buffer[self->used], line, length);
    self->used += length;
    if (self->oldest_us == IW_NEVER) {
        self->oldest_us = at_us;
    }
}

void sim_bus_log_frame(sim_bus_log_t *self, iw_time_us_t at_us, const iw_can_frame_t *frame, bool from_client) {
    char line[CANDUMP_LINE_SIZE];
    if (self->fd < 0) {
        return;
    }
    candump_t written = candump_from_core(frame, (int64_t)at_us, "sim");
    const candump_mark_t sender = from_client ? CANDUMP_SENT : CANDUMP_RECEIVED;
    written.mark = self->write_direction ? sender : CANDUMP_UNMARKED;
    if (written.remote) {
        written.length = 0U;
    }
    append(self, at_us, line, candump_write(&written, line));
}

void sim_bus_log_mark(sim_bus_log_t *self, iw_time_us_t at_us, const char *text) {
    if (self->fd < 0) {
        return;
    }
    char line[LINE_MAX_BYTES];
    int const wanted =
        snprintf(line, sizeof line - 1U, "# %" PRIu64 ".%06" PRIu64 " %s", at_us / US_PER_S, at_us % US_PER_S, text);
    size_t length = ((size_t)wanted < sizeof line - 1U) ? (size_t)wanted : sizeof line - 2U;
    line[length++] = '\n';
    append(self, at_us, line, length);
}
