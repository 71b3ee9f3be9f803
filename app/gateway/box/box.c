// SPDX-License-Identifier: MIT
#include "box.h"

#include "box_reader.h"
#include "box_writer.h"

#include "iwheel_linux/clock.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/// The motors come before the diary.
#define NICE 10
/// Where a process of ours finds its end of the socket.
#define ITS_FD (STDERR_FILENO + 1)
/// A process that dies at once is not started again and again.
#define RESTART_US 10000000U

/// Nothing of the gateway's shall be held: no stream, no signal, no folder, no descriptor but `fd`, which becomes ITS_FD.
static void become(const char *name, int fd) {
    const int null = open("/dev/null", O_RDWR);
    (void)dup2(fd, ITS_FD);
    if (null >= 0) {
        for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; stream++) {
            (void)dup2(null, stream);
        }
    }
    (void)close_range(ITS_FD + 1, UINT_MAX, 0); // Else our clients and our lock would seem to live on in it.
    (void)signal(SIGINT, SIG_IGN);              // It ends when the gateway does.
    (void)signal(SIGTERM, SIG_IGN);
    (void)signal(SIGHUP, SIG_IGN);
    (void)signal(SIGPIPE, SIG_IGN);
    (void)prctl(PR_SET_NAME, name);
    (void)setpriority(PRIO_PROCESS, 0, NICE);
}

/// As fork(), with our end of a socket to the new process in `*out_fd`. -1: there is none.
static pid_t start(const char *name, int *out_fd) {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
        return -1;
    }
    const pid_t process = fork();
    if (process == 0) {
        become(name, ends[1]);
        return 0;
    }
    (void)close(ends[1]);
    if (process < 0) {
        (void)close(ends[0]);
        return -1;
    }
    *out_fd = ends[0];
    return process;
}

static void start_writer(gw_box_t *self) {
    self->started_us = iw_clock_now_us();
    self->pid = start("iwheel-blackbox", &self->fd);
    if (self->pid == 0) {
        gw_box_writer_run(ITS_FD, self->ring, self->config);
        _exit(0);
    }
}

static void start_reader(gw_box_t *self) {
    self->reader.started_us = iw_clock_now_us();
    self->reader.pid = start("iwheel-records", &self->reader.fd);
    if (self->reader.pid == 0) {
        gw_box_reader_run(ITS_FD, self->config->record.directory);
        _exit(0);
    }
}

int gw_box_open(gw_box_t *self, const gateway_config_t *config) {
    *self = (gw_box_t){
        .fd = -1, .reader = {.fd = -1}, .config = config, .ring_size = blackbox_ring_size(config->record.blackbox_s)};
    self->ring = (blackbox_ring_t *)mmap(NULL, self->ring_size, PROT_READ | PROT_WRITE,
                                         MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (self->ring == MAP_FAILED) {
        self->ring = NULL;
        return errno;
    }
    blackbox_ring_init(self->ring, config->record.blackbox_s);
    if (config->record.blackbox_s > 0U) {
        start_writer(self);
        start_reader(self);
    }
    return 0;
}

static void lose_writer(gw_box_t *self) {
    (void)close(self->fd);
    (void)waitpid(self->pid, NULL, WNOHANG);
    self->fd = -1;
}

static void lose_reader(gw_box_t *self) {
    (void)close(self->reader.fd);
    (void)waitpid(self->reader.pid, NULL, WNOHANG);
    self->reader.fd = -1;
}

void gw_box_close(gw_box_t *self) {
    const gw_box_order_t bye = {.last = true};
    if (self->fd >= 0) {
        (void)send(self->fd, &bye, sizeof bye, MSG_DONTWAIT | MSG_NOSIGNAL);
        lose_writer(self);
    }
    if (self->reader.fd >= 0) {
        lose_reader(self);
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

bool gw_box_ask(gw_box_t *self, const gw_box_question_t *question) {
    const bool wanted = self->config->record.blackbox_s > 0U && self->reader.fd < 0;
    if (wanted && iw_clock_now_us() - self->reader.started_us >= RESTART_US) {
        start_reader(self);
    }
    return self->reader.fd >= 0 &&
           send(self->reader.fd, question, sizeof *question, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)sizeof *question;
}

gw_box_heard_t gw_box_hear(gw_box_t *self) {
    const size_t head = offsetof(gw_box_answer_t, text);
    if (self->reader.fd < 0) {
        return GW_BOX_NO_ANSWER;
    }
    const ssize_t got = recv(self->reader.fd, &self->answer, sizeof self->answer, MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return GW_BOX_NO_ANSWER;
    }
    if (got < (ssize_t)head || (size_t)got - head != self->answer.length) {
        lose_reader(self);
        return GW_BOX_READER_ENDED;
    }
    return GW_BOX_ANSWER;
}
