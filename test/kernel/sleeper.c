// SPDX-License-Identifier: MIT
// Sleeps 1 ms over and over and writes down when it was woken late: then the machine, or this kernel, was slow.
//
//     iwheel-sleeper FILE LATE_US    appends lines "t_us late_us" of CLOCK_MONOTONIC
//
// In C and of few system calls: a kernel that is itself a process pays dearly for each, and the witness must not be what it sees.
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#define SLEEP_US 1000
#define US_PER_S 1000000

static int64_t now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * US_PER_S + now.tv_nsec / 1000;
}

int main(int argc, char **argv) {
    int const file = (argc == 3) ? open(argv[1], O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0644) : -1;
    if (file < 0) {
        (void)fprintf(stderr, "usage: iwheel-sleeper FILE LATE_US\n");
        return 64;
    }
    long const limit_us = strtol(argv[2], NULL, 10);
    int64_t before_us = now_us();
    for (;;) {
        struct timespec const wait = {.tv_nsec = SLEEP_US * 1000};
        (void)nanosleep(&wait, NULL);
        int64_t const after_us = now_us();
        long const late_us = (long)(after_us - before_us) - SLEEP_US;
        if (late_us > limit_us) {
            (void)dprintf(file, "%lld %ld\n", (long long)after_us, late_us);
        }
        before_us = after_us;
    }
}
