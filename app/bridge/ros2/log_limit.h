// SPDX-License-Identifier: MIT
/// Limits a log that other programs can fill to LOG_LIMIT_LINES per minute, and counts the dropped lines. Pure: no
/// clock, no I/O.
#ifndef ROS2_LOG_LIMIT_H
#define ROS2_LOG_LIMIT_H

#include <stdbool.h>
#include <stdint.h>

#define LOG_LIMIT_LINES 20U
#define LOG_LIMIT_US    60000000U

typedef struct {
    uint64_t since_us; ///< Beginning of this minute; 0: no line yet.
    unsigned lines;    ///< Lines written in this minute.
    uint64_t dropped;  ///< Lines dropped in this minute.
} log_limit_t;

/// Returns true if the caller shall write this line. Writes to `*out_dropped` the number of lines that were dropped in
/// the minute that has ended; if it is not 0, the caller reports it first.
bool log_limit_pass(log_limit_t *self, uint64_t now_us, uint64_t *out_dropped);

#endif
