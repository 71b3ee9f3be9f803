// SPDX-License-Identifier: MIT
/// Sends the frames of a nominal bus, faster: so many a second, evenly in bursts of a millisecond. Prints how many it sent.
/// usage: flood INTERFACE FRAMES_PER_S SECONDS
#define _GNU_SOURCE
#include "timed.h"

#include "codec.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#define BURST_MAX 64
#define PER_S     1000

static struct can_frame wire[BENCH_FRAMES];

static void prepare(void) {
    bench_fill();
    for (uint32_t i = 0; i < BENCH_FRAMES; ++i) {
        wire[i] = (struct can_frame){.can_id = bench_frame[i].id, .len = bench_frame[i].dlc};
        (void)memcpy(wire[i].data, bench_frame[i].data, bench_frame[i].dlc);
    }
}

static long burst(int can, long count, long sent) {
    struct mmsghdr message[BURST_MAX] = {0};
    struct iovec part[BURST_MAX];
    for (long i = 0; i < count; ++i) {
        part[i] =
            (struct iovec){.iov_base = &wire[(unsigned long)(sent + i) % BENCH_FRAMES], .iov_len = sizeof wire[0]};
        message[i].msg_hdr = (struct msghdr){.msg_iov = &part[i], .msg_iovlen = 1};
    }
    return timed_need(sendmmsg(can, message, (unsigned)count, 0), "send");
}

int main(int argc, char **argv) {
    const int can = timed_can(argc == 4 ? argv[1] : "", CAN_INV_FILTER);
    const long rate = atol(argv[2]);
    const long bursts = (long)(atof(argv[3]) * PER_S);
    int64_t due_ns = timed_now_ns(CLOCK_MONOTONIC);
    long sent = 0;
    prepare();
    for (long i = 1; i <= bursts; ++i) {
        const long owed = rate * i / PER_S - sent;
        due_ns += TIMED_NS_PER_S / PER_S;
        timed_sleep_until_ns(due_ns);
        sent += owed > 0 ? burst(can, owed < BURST_MAX ? owed : BURST_MAX, sent) : 0;
    }
    (void)printf("%ld\n", sent);
    return 0;
}
