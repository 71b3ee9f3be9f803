// SPDX-License-Identifier: MIT
/// Bounds a log that others can fill: LOG_LIMIT_LINES in a minute, then a count of what was left out. Pure: no clock, no I/O.
#ifndef ROS2_LOG_LIMIT_H
#define ROS2_LOG_LIMIT_H

#include <stdbool.h>
#include <stdint.h>

#define LOG_LIMIT_LINES 20U
#define LOG_LIMIT_US    60000000U

typedef struct {
    uint64_t since_us; ///< Beginning of this minute; 0: none yet.
    unsigned lines;
    uint64_t dropped;
} log_limit_t;

/// True: write this line. `*out_dropped`: so many were left out in the minute that has ended; write that first. 0: none.
bool log_limit_pass(log_limit_t *self, uint64_t now_us, uint64_t *out_dropped);

#endif
