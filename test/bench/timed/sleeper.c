// SPDX-License-Identifier: MIT
/// Sleeps a millisecond again and again; at its end it prints the longest delay in microseconds: then the machine stalled.
#include "timed.h"

#include <signal.h>
#include <stdio.h>

static volatile sig_atomic_t ended;

static void end(int number) {
    (void)number;
    ended = 1;
}

int main(void) {
    const struct sigaction action = {.sa_handler = end};
    int64_t worst_ns = 0;
    (void)sigaction(SIGTERM, &action, NULL);
    while (ended == 0) {
        const int64_t due_ns = timed_now_ns(CLOCK_MONOTONIC) + TIMED_NS_PER_S / 1000;
        timed_sleep_until_ns(due_ns);
        const int64_t late_ns = timed_now_ns(CLOCK_MONOTONIC) - due_ns;
        worst_ns = (late_ns > worst_ns) ? late_ns : worst_ns;
    }
    (void)printf("%lld\n", (long long)(worst_ns / 1000));
    return 0;
}
