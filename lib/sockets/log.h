// SPDX-License-Identifier: MIT
/// Messages for people, on stderr. Never waits: what stderr does not take at once is dropped and counted, and so is
/// what comes faster than people read (40 lines at once, then 5 a second). The next line that passes tells how many
/// were dropped. Lines are plain (iwheel_northbound/text.h), whatever stands in their arguments.
#ifndef GATEWAY_LOG_H
#define GATEWAY_LOG_H

#include "iwheel/types.h"

typedef enum { SOCK_LOG_ERROR = 0, SOCK_LOG_WARNING, SOCK_LOG_INFO, SOCK_LOG_DEBUG, SOCK_LOG_LEVELS } sock_log_level_t;

typedef struct sock_log {
    const char *program;    ///< Whose lines they are; iwheel-gateway, unless changed after opening.
    iw_time_us_t credit_us; ///< Tokens were last added then.
    uint32_t credit;        ///< Lines that may still pass.
    uint32_t dropped;
    int fd;      ///< Of its own file description where possible, so that O_NONBLOCK is nobody else's.
    bool socket; ///< Sent instead of written.
    sock_log_level_t level;
} sock_log_t;

void sock_log_open(sock_log_t *self, sock_log_level_t level);
void sock_log_close(sock_log_t *self);

__attribute__((format(printf, 3, 4))) void sock_log(sock_log_t *self, sock_log_level_t level, const char *format, ...);

/// False if the word is none of error, warning, info, debug.
bool sock_log_level_of(const char *word, sock_log_level_t *out_level);

#endif
