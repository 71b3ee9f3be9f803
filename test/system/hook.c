// SPDX-License-Identifier: MIT
// Faults inside the gateway's process that no signal can make. Preloaded into it by the tests of test/system (LD_PRELOAD); the
// gateway itself knows nothing of it.
//
// $IWHEEL_HOOK names a file of one line, looked at now and then:
//
//     clients   the call that reads a client's request never returns
//     frames    nor does the one that reads frames of the bus
//     button    nor does the one that reads the simulator's button
//     asleep N  the machine was suspended for N s: the clocks say so
#include <dlfcn.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define LINE_SIZE 32

static const char asleep[] = "asleep ";

/// What the file says; empty without one.
static void read_order(char line[LINE_SIZE]) {
    const char *path = getenv("IWHEEL_HOOK");
    const int fd = (path == NULL) ? -1 : open(path, O_RDONLY | O_CLOEXEC);
    const ssize_t length = (fd < 0) ? -1 : read(fd, line, LINE_SIZE - 1);
    line[(length > 0) ? length : 0] = '\0';
    if (fd >= 0) {
        (void)close(fd);
    }
}

static void hang_if(const char *word) {
    char line[LINE_SIZE];
    read_order(line);
    while (strncmp(line, word, strlen(word)) == 0) {
        (void)usleep(10000); // Alive, but it does not come back.
        read_order(line);
    }
}

/// The function that ours stands in front of.
static void find(const char *name, void *out_function, size_t size) {
    void *const symbol = dlsym(RTLD_NEXT, name);
    memcpy(out_function, &symbol, size);
}

ssize_t recv(int fd, void *buffer, size_t size, int flags) {
    ssize_t (*next)(int, void *, size_t, int);
    find("recv", &next, sizeof next);
    int type = 0;
    struct sockaddr_storage address = {0};
    socklen_t length = sizeof address;
    socklen_t type_length = sizeof type;
    (void)getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &type_length);
    const bool ours = getsockname(fd, (struct sockaddr *)&address, &length) == 0 && length > sizeof(sa_family_t);
    if (type == SOCK_STREAM) {
        hang_if(ours ? "clients" : "button"); // A connection that was accepted has our name, one that we made has none.
    }
    return next(fd, buffer, size, flags);
}

int recvmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags, struct timespec *timeout) {
    int (*next)(int, struct mmsghdr *, unsigned, int, struct timespec *);
    find("recvmmsg", &next, sizeof next);
    hang_if("frames");
    return next(fd, messages, count, flags, timeout);
}

int clock_gettime(clockid_t clock, struct timespec *out_now) {
    int (*next)(clockid_t, struct timespec *);
    char line[LINE_SIZE] = "";
    find("clock_gettime", &next, sizeof next);
    const int result = next(clock, out_now);
    if (clock == CLOCK_BOOTTIME) {
        read_order(line);
    }
    if (strncmp(line, asleep, sizeof asleep - 1U) == 0) {
        out_now->tv_sec += strtol(line + sizeof asleep - 1U, NULL, 10);
    }
    return result;
}
