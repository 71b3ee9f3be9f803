// SPDX-License-Identifier: MIT
/// Sends the frames of a nominal bus at this rate, evenly in bursts of a millisecond. Frames that are late are dropped,
/// because no bus carries more than fits into the time. Prints the number of sent frames.
/// usage: flood INTERFACE FRAMES_PER_S SECONDS
#define _GNU_SOURCE
#include "timed.h"

#include "bench_codec.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#define BURST_MAX 64
#define PER_S     1000

static struct can_frame wire[BENCH_FRAMES];

static void prepare(void) {
    bench_fill();
    for (uint32_t i = 0; i < BENCH_FRAMES; i++) {
        wire[i] = (struct can_frame){.can_id = bench_frame[i].id, .len = bench_frame[i].dlc};
        memcpy(wire[i].data, bench_frame[i].data, bench_frame[i].dlc);
    }
}

static long burst(int can, long count, long sent) {
    struct mmsghdr message[BURST_MAX] = {0};
    struct iovec part[BURST_MAX];
    for (long i = 0; i < count; i++) {
        part[i] =
            (struct iovec){.iov_base = &wire[(unsigned long)(sent + i) % BENCH_FRAMES], .iov_len = sizeof wire[0]};
        message[i].msg_hdr = (struct msghdr){.msg_iov = &part[i], .msg_iovlen = 1};
    }
    return timed_need(sendmmsg(can, message, (unsigned)count, 0), "send");
}

int main(int argc, char **argv) {
    const int can = timed_can((argc == 4 && atol(argv[2]) <= (long)BURST_MAX * PER_S) ? argv[1] : "", CAN_INV_FILTER);
    const long rate = atol(argv[2]);
    const int64_t slot_ns = TIMED_NS_PER_S / PER_S;
    const int64_t end_ns = timed_now_ns(CLOCK_MONOTONIC) + (int64_t)(atof(argv[3]) * (double)TIMED_NS_PER_S);
    int64_t due_ns = timed_now_ns(CLOCK_MONOTONIC);
    long sent = 0;
    prepare();
    while (due_ns < end_ns) {
        const int64_t now_ns = timed_now_ns(CLOCK_MONOTONIC);
        due_ns = (now_ns > due_ns + slot_ns) ? now_ns : due_ns;
        due_ns += slot_ns;
        timed_sleep_until_ns(due_ns);
        sent += burst(can, rate / PER_S, sent);
    }
    (void)printf("%ld\n", sent);
    return 0;
}
