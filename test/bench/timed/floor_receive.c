// SPDX-License-Identifier: MIT
/// The floor of receiving: batches from one socket, decoded into one structure. Prints the number of frames when it is ended.
/// usage: floor_receive INTERFACE
#define _GNU_SOURCE
#include "timed.h"

#include "bench_codec.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>

#define BATCH 32U

iw_can_frame_t bench_frame[BENCH_FRAMES];
volatile bench_setpoint_t bench_setpoint;
static volatile sig_atomic_t ended;

static void end(int number) {
    (void)number;
    ended = 1;
}

/// Copies the frame to where the codec's floor reads it.
static void decode(const struct can_frame *frame, uint32_t at) {
    bench_frame[at] = (iw_can_frame_t){.id = frame->can_id, .dlc = frame->len};
    memcpy(bench_frame[at].data, frame->data, sizeof frame->data);
}

int main(int argc, char **argv) {
    struct mmsghdr message[BATCH] = {0};
    struct iovec part[BATCH];
    struct can_frame frame[BATCH];
    const struct sigaction action = {.sa_handler = end};
    const int can = timed_can((argc == 2) ? argv[1] : "", 0);
    unsigned long frames = 0;
    uint32_t at = 0;
    (void)sigaction(SIGTERM, &action, NULL);
    for (uint32_t i = 0; i < BATCH; i++) {
        part[i] = (struct iovec){.iov_base = &frame[i], .iov_len = sizeof frame[i]};
        message[i].msg_hdr = (struct msghdr){.msg_iov = &part[i], .msg_iovlen = 1};
    }
    while (ended == 0) {
        const int count = recvmmsg(can, message, BATCH, MSG_WAITFORONE, NULL);
        for (int i = 0; i < count; i++) {
            decode(&frame[i], at);
            at = (at + 1U < BENCH_FRAMES) ? at + 1U : 0U;
            (void)((at == 0U) ? bench_decode(1) : 0U);
        }
        frames += (count > 0) ? (unsigned long)count : 0UL;
    }
    (void)printf("%lu\n", frames);
    return 0;
}
