// SPDX-License-Identifier: MIT
#include "child.h"

#include "iwheel_linux/clock.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/// Descriptor of the child's end of the socket.
#define ITS_FD (STDERR_FILENO + 1)
/// Interval before another start, so that a child that dies immediately is not started again and again.
#define RESTART_US 10000000U

static void become(const gw_child_work_t *work, int fd) {
    const int null = open("/dev/null", O_RDWR);
    (void)dup2(fd, ITS_FD);
    if (null >= 0) {
        for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; stream++) {
            (void)dup2(null, stream);
        }
        (void)close(null);
    }
    closefrom(ITS_FD + 1);         // Otherwise the clients and the lock of the gateway would stay open in it.
    (void)signal(SIGINT, SIG_IGN); // It ends when the gateway does.
    (void)signal(SIGTERM, SIG_IGN);
    (void)signal(SIGHUP, SIG_IGN);
    (void)signal(SIGPIPE, SIG_IGN);
    (void)prctl(PR_SET_NAME, work->name);
    (void)setpriority(PRIO_PROCESS, 0, work->nice);
}

int gw_child_start(gw_child_t *self, const gw_child_work_t *work) {
    int ends[2];
    *self = (gw_child_t){.work = *work, .fd = -1, .started_us = iwl_clock_now_us()};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
        return errno;
    }
    self->pid = fork();
    if (self->pid == 0) {
        become(&self->work, ends[1]);
        self->work.run(ITS_FD, self->work.context);
        _exit(0);
    }
    const int error = (self->pid < 0) ? errno : 0;
    (void)close(ends[1]);
    if (error != 0) {
        (void)close(ends[0]);
        return error;
    }
    self->fd = ends[0];
    return 0;
}

bool gw_child_revive(gw_child_t *self) {
    if (self->fd < 0 && self->work.run != NULL && iwl_clock_now_us() - self->started_us >= RESTART_US) {
        const gw_child_work_t work = self->work;
        (void)gw_child_start(self, &work);
    }
    return self->fd >= 0;
}

bool gw_child_send(const gw_child_t *self, const void *message, size_t length) {
    return send(self->fd, message, length, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)length;
}

gw_child_news_t gw_child_receive(gw_child_t *self, void *out_message, size_t size, size_t *out_length) {
    if (self->fd < 0) {
        return GW_CHILD_SILENT;
    }
    const ssize_t got = recv(self->fd, out_message, size, MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return GW_CHILD_SILENT;
    }
    if (got <= 0) {
        gw_child_close(self);
        return GW_CHILD_ENDED;
    }
    *out_length = (size_t)got;
    return GW_CHILD_MESSAGE;
}

void gw_child_close(gw_child_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
        (void)waitpid(self->pid, NULL, WNOHANG);
        self->fd = -1;
    }
}
