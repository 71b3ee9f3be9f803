// SPDX-License-Identifier: MIT
/// Prints the kernel's stamps, in nanoseconds, of all frames of one id, from the first one on. usage: stamps INTERFACE ID_HEX SECONDS
#include "timed.h"

#include <stdio.h>
#include <stdlib.h>

#define STAMPS_MAX 100000U
#define FIRST_ms   20000

static int64_t stamp[STAMPS_MAX];

int main(int argc, char **argv) {
    const canid_t id = (canid_t)strtoul((argc == 4) ? argv[2] : "", NULL, 16);
    const int can = timed_can(argv[1], id);
    struct can_frame frame;
    uint32_t count = 0;
    timed_ask_for_stamps(can);
    (void)timed_receive(can, id, &frame, &stamp[0], FIRST_ms);
    const int64_t end_ns = timed_now_ns(CLOCK_MONOTONIC) + (int64_t)(atof(argv[3]) * (double)TIMED_NS_PER_S);
    while (count < STAMPS_MAX && timed_now_ns(CLOCK_MONOTONIC) < end_ns) {
        count += timed_receive(can, id, &frame, &stamp[count], 100) ? 1U : 0U;
    }
    for (uint32_t i = 0; i < count; i++) {
        (void)printf("%lld\n", (long long)stamp[i]);
    }
    return 0;
}
