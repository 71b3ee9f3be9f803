// SPDX-License-Identifier: MIT
/// Starts a program that sends a frame, again and again, and prints the time in nanoseconds until the frame is on the bus.
/// usage: ask_program INTERFACE COUNT PROGRAM [ARGUMENT...]
#include "timed.h"

#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>

extern char **environ;

int main(int argc, char **argv) {
    const int can = timed_can((argc >= 4) ? argv[1] : "", TIMED_LEFT);
    timed_ask_for_stamps(can);
    for (long i = atol(argv[2]); i > 0; i--) {
        struct can_frame frame;
        int64_t at_ns;
        pid_t child;
        const int64_t asked_ns = timed_now_ns(CLOCK_REALTIME);
        if (posix_spawnp(&child, argv[3], NULL, NULL, &argv[3], environ) != 0) {
            timed_fail(argv[3]);
        }
        if (!timed_receive(can, TIMED_LEFT, &frame, &at_ns, 2000)) {
            timed_fail("no frame followed");
        }
        (void)printf("%lld\n", (long long)(at_ns - asked_ns));
        (void)waitpid(child, NULL, 0);
    }
    return 0;
}
