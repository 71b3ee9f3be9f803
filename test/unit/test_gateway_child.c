// SPDX-License-Identifier: MIT
#include "process/child.h"

#include "unit.h"
#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <stddef.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#define MOST_FD 100

/// The work of the child: sends which of its descriptors are open.
static void send_open(int fd, const void *context) {
    (void)context;
    char open_ones[MOST_FD + 1];
    for (int i = 0; i <= MOST_FD; i++) {
        open_ones[i] = (fcntl(i, F_GETFD) >= 0) ? 1 : 0;
    }
    (void)send(fd, open_ones, sizeof open_ones, MSG_NOSIGNAL);
}

/// Returns the number of open descriptors of a child, besides its streams and its end of the socket; -1: no answer.
static int left_open(void) {
    const gw_child_work_t work = {.name = "iwheel-test", .run = send_open};
    gw_child_t child;
    char open_ones[MOST_FD + 1] = "";
    int count = 0;
    if (fcntl(STDIN_FILENO, F_DUPFD, MOST_FD) != MOST_FD || gw_child_start(&child, &work) != 0) {
        return -1;
    }
    struct pollfd entry = {.fd = child.fd, .events = POLLIN};
    if (poll(&entry, 1, 10000) != 1 || recv(child.fd, open_ones, sizeof open_ones, 0) != sizeof open_ones) {
        return -1;
    }
    for (int i = STDERR_FILENO + 2; i <= MOST_FD; i++) {
        count += open_ones[i];
    }
    (void)waitpid(child.pid, NULL, 0);
    (void)close(child.fd);
    (void)close(MOST_FD);
    return count;
}

/// From now on close_range does not exist, as before Linux 5.9, or with a container's filter that does not know it.
static bool forbid_close_range(void) {
    struct sock_filter lines[] = {BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
                                  BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_close_range, 0, 1),
                                  BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS),
                                  BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
    const struct sock_fprog program = {sizeof lines / sizeof lines[0], lines};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

TEST(test_child_inherits_no_descriptor) {
    TEST_ASSERT_EQUAL(0, left_open());
}

TEST(test_child_inherits_no_descriptor_without_close_range) {
    enum { NO_FILTER = 100 };
    int status = 0;
    const pid_t process = fork();
    if (process == 0) {
        _exit(forbid_close_range() ? left_open() : NO_FILTER);
    }
    TEST_ASSERT_EQUAL(process, waitpid(process, &status, 0));
    if (WIFEXITED(status) && WEXITSTATUS(status) == NO_FILTER) {
        TEST_IGNORE_MESSAGE("this machine permits no filter of system calls");
    }
    TEST_ASSERT_EQUAL(0, status);
}
