// SPDX-License-Identifier: MIT
/// Prints, in nanoseconds between the kernel's stamps, the delay of each right setpoint after its left one; -1 where the next left one
/// came first. usage: pair_stamps INTERFACE SECONDS
#include "timed.h"

#include <stdio.h>
#include <stdlib.h>

#define PAIRS_MAX 100000U
#define FIRST_ms  20000

static int64_t gap[PAIRS_MAX];

int main(int argc, char **argv) {
    const int can = timed_can((argc == 3) ? argv[1] : "", 0);
    struct can_frame frame;
    int64_t at_ns = 0;
    int64_t left_ns = -1;
    uint32_t count = 0;
    timed_ask_for_stamps(can);
    (void)timed_receive(can, TIMED_LEFT, &frame, &at_ns, FIRST_ms);
    const int64_t end_ns = timed_now_ns(CLOCK_MONOTONIC) + (int64_t)(atof(argv[2]) * (double)TIMED_NS_PER_S);
    while (count < PAIRS_MAX && timed_now_ns(CLOCK_MONOTONIC) < end_ns) {
        const int came = timed_receive(can, 0, &frame, &at_ns, 100);
        if (came && frame.can_id == TIMED_LEFT) {
            gap[count] = -1;
            count += (left_ns >= 0) ? 1U : 0U;
            left_ns = at_ns;
        } else if (came && frame.can_id == TIMED_RIGHT && left_ns >= 0) {
            gap[count++] = at_ns - left_ns;
            left_ns = -1;
        }
    }
    for (uint32_t i = 0; i < count; i++) {
        (void)printf("%lld\n", (long long)gap[i]);
    }
    return 0;
}
