// SPDX-License-Identifier: MIT
#include "iwheel_linux/clock.h"

#include <time.h>

static iw_time_us_t read_us(clockid_t clock) {
    struct timespec now;
    (void)clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000U + (uint64_t)now.tv_nsec / 1000U;
}

iw_time_us_t iwl_clock_now_us(void) {
    return read_us(CLOCK_MONOTONIC);
}

iw_time_us_t iwl_clock_awake_us(iw_time_us_t suspended_us) {
    const iw_time_us_t whole_us = read_us(CLOCK_BOOTTIME);
    return (whole_us > suspended_us) ? whole_us - suspended_us : 0U;
}

iw_time_us_t iwl_clock_read(iw_time_us_t *out_suspended_us) {
    // Read first: an interruption between the two readings makes the suspend appear shorter, never longer.
    const iw_time_us_t total_us = read_us(CLOCK_BOOTTIME);
    const iw_time_us_t running_us = read_us(CLOCK_MONOTONIC);
    *out_suspended_us = (total_us > running_us) ? total_us - running_us : 0U;
    return running_us;
}

iw_time_us_t iwl_clock_suspended_us(void) {
    iw_time_us_t suspended_us;
    (void)iwl_clock_read(&suspended_us);
    return suspended_us;
}

int64_t iwl_clock_wall_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}
