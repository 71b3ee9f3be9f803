// SPDX-License-Identifier: MIT
#include "box.h"

#include "box_writer.h"

#include "iwheel_linux/clock.h"

#include <errno.h>
#include <limits.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/// A writer that dies at once is not started again and again.
#define RESTART_US 10000000U

static void start_writer(gw_box_t *self) {
    int ends[2];
    self->started_us = iw_clock_now_us();
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
        return;
    }
    const pid_t process = fork();
    if (process == 0) {
        (void)dup2(ends[1], STDERR_FILENO + 1);
        (void)close_range(STDERR_FILENO + 2, UINT_MAX, 0); // Else our clients and our lock would seem to live on in it.
        gw_box_writer_run(STDERR_FILENO + 1, self->ring, self->config);
        _exit(0);
    }
    (void)close(ends[1]);
    if (process < 0) {
        (void)close(ends[0]);
        return;
    }
    self->fd = ends[0];
    self->pid = process;
}

int gw_box_open(gw_box_t *self, const gateway_config_t *config) {
    *self = (gw_box_t){.fd = -1, .config = config, .ring_size = blackbox_ring_size(config->record.blackbox_s)};
    self->ring = (blackbox_ring_t *)mmap(NULL, self->ring_size, PROT_READ | PROT_WRITE,
                                         MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (self->ring == MAP_FAILED) {
        self->ring = NULL;
        return errno;
    }
    blackbox_ring_init(self->ring, config->record.blackbox_s);
    if (config->record.blackbox_s > 0U) {
        start_writer(self);
    }
    return 0;
}

static void lose_writer(gw_box_t *self) {
    (void)close(self->fd);
    (void)waitpid(self->pid, NULL, WNOHANG);
    self->fd = -1;
}

void gw_box_close(gw_box_t *self) {
    const gw_box_order_t bye = {.last = true};
    if (self->fd >= 0) {
        (void)send(self->fd, &bye, sizeof bye, MSG_DONTWAIT | MSG_NOSIGNAL);
        lose_writer(self);
    }
    if (self->ring != NULL) {
        (void)munmap(self->ring, self->ring_size);
        self->ring = NULL;
    }
}

bool gw_box_write(gw_box_t *self, const gw_box_order_t *order) {
    if (self->fd < 0 && iw_clock_now_us() - self->started_us >= RESTART_US) {
        start_writer(self);
    }
    return self->fd >= 0 && send(self->fd, order, sizeof *order, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)sizeof *order;
}

gw_box_news_t gw_box_take(gw_box_t *self) {
    gw_box_result_t result;
    if (self->fd < 0) {
        return GW_BOX_NOTHING;
    }
    const ssize_t got = recv(self->fd, &result, sizeof result, MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return GW_BOX_NOTHING;
    }
    if (got != (ssize_t)sizeof result) {
        lose_writer(self);
        return GW_BOX_WRITER_ENDED;
    }
    self->last = result;
    return GW_BOX_RESULT;
}
