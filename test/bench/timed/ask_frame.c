// SPDX-License-Identifier: MIT
/// Sends a frame again and again, and prints the time in nanoseconds until a line follows: from standard input, or from a socket.
/// usage: ask_frame INTERFACE COUNT [SOCKET FIRST_LINE]
#include "timed.h"

#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define PAUSE_NS  3000000
#define SETTLE_NS 200000000
#define ANSWER_ms 1000

static void forget(int from) {
    char waste[65536];
    while (read(from, waste, sizeof waste) > 0) {
    }
}

static int open_source(int argc, char **argv) {
    const int from = (argc > 4) ? timed_connect(argv[3]) : STDIN_FILENO;
    if (argc > 4) {
        (void)timed_need((int)write(from, argv[4], strlen(argv[4])), "first line");
        (void)timed_need((int)write(from, "\n", 1), "first line");
    }
    (void)timed_need(fcntl(from, F_SETFL, O_NONBLOCK), "source of lines");
    return from;
}

int main(int argc, char **argv) {
    const int can = timed_can((argc >= 3) ? argv[1] : "", CAN_INV_FILTER);
    const int from = open_source(argc, argv);
    struct can_frame frame = {.can_id = 0x100, .len = 4};
    struct pollfd ready = {.fd = from, .events = POLLIN};
    timed_sleep_until_ns(timed_now_ns(CLOCK_MONOTONIC) + SETTLE_NS);
    for (long i = atol(argv[2]); i > 0; i--) {
        char line[4096];
        timed_sleep_until_ns(timed_now_ns(CLOCK_MONOTONIC) + PAUSE_NS);
        forget(from);
        frame.data[3] = (uint8_t)i;
        const int64_t asked_ns = timed_now_ns(CLOCK_MONOTONIC);
        (void)timed_need((int)write(can, &frame, sizeof frame), "frame");
        if (poll(&ready, 1, ANSWER_ms) > 0 && read(from, line, sizeof line) > 0) {
            (void)printf("%lld\n", (long long)(timed_now_ns(CLOCK_MONOTONIC) - asked_ns));
        }
    }
    return 0;
}
