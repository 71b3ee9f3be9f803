// SPDX-License-Identifier: MIT
// Faults inside a program that no signal can cause. The tests of test/system preload this library (LD_PRELOAD); the program
// itself does not know it.
//
// $IWHEEL_HOOK names a file of one line, which is read at each of these calls:
//
//     clients   the call that reads a client's request never returns
//     frames    the call that reads frames of the bus never returns
//     button    the call that reads the simulator's button never returns
//     asleep N  the clocks pass as if the machine had been suspended for N s
//
// $IWHEEL_DELAYS is a seed: one system call in 32 begins 0 to 2 ms late, as if another process ran first.
#include <dlfcn.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define LINE_SIZE 32
#define ONE_IN    32U
#define DELAY_US  2000U

static const char asleep[] = "asleep ";

/// The line of the file; empty without a file.
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
        (void)usleep(10000); // The process is alive, but the call does not return.
        read_order(line);
    }
}

/// Sleeps before one call in 32. The order of the calls and the seed alone decide which ones, and for how long.
static void delay(void) {
    static uint64_t state;
    const char *seed = getenv("IWHEEL_DELAYS");
    if (seed == NULL) {
        return;
    }
    if (state == 0) {
        state = (strtoull(seed, NULL, 10) + 1U) * 0x9E3779B97F4A7C15U;
    }
    state = state * 6364136223846793005U + 1442695040888963407U;
    const uint32_t draw = (uint32_t)(state >> 33U);
    if (draw % ONE_IN == 0) {
        const struct timespec time = {.tv_nsec = (long)(draw / ONE_IN % DELAY_US) * 1000L};
        (void)nanosleep(&time, NULL);
    }
}

/// The function that ours replaces.
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
        hang_if(ours ? "clients"
                     : "button"); // An accepted connection has the name of our socket; one that we made has none.
    }
    delay();
    return next(fd, buffer, size, flags);
}

int recvmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags, struct timespec *timeout) {
    int (*next)(int, struct mmsghdr *, unsigned, int, struct timespec *);
    find("recvmmsg", &next, sizeof next);
    hang_if("frames");
    delay();
    return next(fd, messages, count, flags, timeout);
}

int clock_gettime(clockid_t clock, struct timespec *out_now) {
    int (*next)(clockid_t, struct timespec *);
    char line[LINE_SIZE] = "";
    find("clock_gettime", &next, sizeof next);
    delay();
    const int result = next(clock, out_now);
    if (clock == CLOCK_BOOTTIME) {
        read_order(line);
    }
    if (strncmp(line, asleep, sizeof asleep - 1U) == 0) {
        out_now->tv_sec += strtol(line + sizeof asleep - 1U, NULL, 10);
    }
    return result;
}

ssize_t send(int fd, const void *buffer, size_t size, int flags) {
    ssize_t (*next)(int, const void *, size_t, int);
    find("send", &next, sizeof next);
    delay();
    return next(fd, buffer, size, flags);
}

int sendmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags) {
    int (*next)(int, struct mmsghdr *, unsigned, int);
    find("sendmmsg", &next, sizeof next);
    delay();
    return next(fd, messages, count, flags);
}

int epoll_wait(int fd, struct epoll_event *events, int count, int timeout_ms) {
    int (*next)(int, struct epoll_event *, int, int);
    find("epoll_wait", &next, sizeof next);
    delay();
    return next(fd, events, count, timeout_ms);
}

int timerfd_settime(int fd, int flags, const struct itimerspec *new, struct itimerspec *old) {
    int (*next)(int, int, const struct itimerspec *, struct itimerspec *);
    find("timerfd_settime", &next, sizeof next);
    delay();
    return next(fd, flags, new, old);
}
