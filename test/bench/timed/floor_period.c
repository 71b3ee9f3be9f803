// SPDX-License-Identifier: MIT
/// The floor of a setpoint's period: an absolute timer and two frames. usage: floor_period INTERFACE PERIOD_US
#include "timed.h"

#include <stdlib.h>
#include <sys/timerfd.h>
#include <unistd.h>

int main(int argc, char **argv) {
    const int can = timed_can((argc == 3) ? argv[1] : "", CAN_INV_FILTER);
    const long period_ns = atol(argv[2]) * 1000L;
    const int timer = timed_need(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC), "timer");
    const int64_t first_ns = timed_now_ns(CLOCK_MONOTONIC) + period_ns;
    const struct itimerspec every = {
        .it_interval = {.tv_nsec = period_ns},
        .it_value = {.tv_sec = (time_t)(first_ns / TIMED_NS_PER_S), .tv_nsec = (long)(first_ns % TIMED_NS_PER_S)}};
    (void)timed_need(timerfd_settime(timer, TFD_TIMER_ABSTIME, &every, NULL), "timer");
    for (uint64_t passed; read(timer, &passed, sizeof passed) == (ssize_t)sizeof passed;) {
        timed_send_pair(can, 100, 100);
    }
    return 0;
}
