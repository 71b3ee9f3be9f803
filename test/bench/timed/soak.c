// SPDX-License-Identifier: MIT
/// Takes all the time that nobody else wants, and prints how many rounds that made: what another program costs is what is missing then.
/// usage: soak SECONDS
#define _GNU_SOURCE
#include "timed.h"

#include <sched.h>
#include <stdio.h>
#include <stdlib.h>

#define ROUNDS_PER_LOOK 1000U

int main(int argc, char **argv) {
    const struct sched_param none = {0};
    const int64_t end_ns =
        timed_now_ns(CLOCK_MONOTONIC) + (int64_t)(atof(argc == 2 ? argv[1] : "1") * (double)TIMED_NS_PER_S);
    volatile uint32_t spent = 0;
    unsigned long looks = 0;
    (void)timed_need(sched_setscheduler(0, SCHED_IDLE, &none), "SCHED_IDLE");
    while (timed_now_ns(CLOCK_MONOTONIC) < end_ns) {
        for (uint32_t i = 0; i < ROUNDS_PER_LOOK; ++i) {
            spent = spent + i;
        }
        ++looks;
    }
    (void)printf("%lu\n", looks);
    return 0;
}
