// SPDX-License-Identifier: MIT
#include "hours_rig.h"

#include "iwheel_linux/clock.h"

#include "unity.h"

#include <dirent.h>
#include <errno.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>

#define WALL_S 1700000000

bool hours_gateway_hangs;
static bool in_daemon;

int __wrap_clock_gettime(clockid_t clock, struct timespec *out_time);
int __real_ppoll(struct pollfd *entries, nfds_t count, const struct timespec *timeout, const sigset_t *mask);
int __wrap_ppoll(struct pollfd *entries, nfds_t count, const struct timespec *timeout, const sigset_t *mask);
int __real_connect(int fd, const struct sockaddr *address, socklen_t size);
int __wrap_connect(int fd, const struct sockaddr *address, socklen_t size);

int __wrap_clock_gettime(clockid_t clock, struct timespec *out_time) {
    const iw_time_us_t now_us = (clock == CLOCK_REALTIME) ? (iw_time_us_t)iwl_clock_wall_us() : daemon_rig.now_us;
    *out_time = (struct timespec){.tv_sec = (time_t)(now_us / 1000000U), .tv_nsec = (long)(now_us % 1000000U * 1000U)};
    out_time->tv_sec += (clock == CLOCK_REALTIME) ? WALL_S : 0;
    return 0;
}

void hours_run_gateway(unsigned for_ms) {
    if (daemon_rig.daemon == NULL || hours_gateway_hangs) {
        daemon_rig.now_us += MS(for_ms);
        return;
    }
    in_daemon = true;
    daemon_rig_run(for_ms);
    in_daemon = false;
}

int __wrap_ppoll(struct pollfd *entries, nfds_t count, const struct timespec *timeout, const sigset_t *mask) {
    static const struct timespec at_once = {0, 0};
    if (in_daemon) {
        return __real_ppoll(entries, count, timeout, mask);
    }
    TEST_ASSERT_NOT_NULL_MESSAGE(timeout, "the bridge would wait forever");
    const iw_time_us_t end_us =
        daemon_rig.now_us + (iw_time_us_t)timeout->tv_sec * 1000000U + (iw_time_us_t)timeout->tv_nsec / 1000U;
    int ready = __real_ppoll(entries, count, &at_once, mask);
    while (ready == 0 && daemon_rig.now_us < end_us) {
        hours_run_gateway(1);
        ready = __real_ppoll(entries, count, &at_once, mask);
    }
    return ready;
}

int __wrap_connect(int fd, const struct sockaddr *address, socklen_t size) {
    struct sockaddr_un there = {.sun_family = AF_UNIX};
    socklen_t length = sizeof there;
    if (address->sa_family != AF_UNIX || ((const struct sockaddr_un *)(const void *)address)->sun_path[0] != '/') {
        return __real_connect(fd, address, size);
    }
    if (daemon_rig.daemon == NULL) {
        errno = ECONNREFUSED;
        return -1;
    }
    const int listener = daemon_rig.daemon->clients.listener[SOCK_DRIVE].fd;
    TEST_ASSERT_EQUAL_INT(0, getsockname(listener, (struct sockaddr *)&there, &length));
    return __real_connect(fd, (const struct sockaddr *)&there, length);
}

int64_t hours_wall_ns(void) {
    struct timespec now;
    (void)__wrap_clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

unsigned hours_descriptors(void) {
    unsigned count = 0;
    DIR *folder = opendir("/proc/self/fd");
    while (folder != NULL && readdir(folder) != NULL) {
        count++;
    }
    (void)closedir(folder);
    return count;
}
