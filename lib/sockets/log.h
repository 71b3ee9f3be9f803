// SPDX-License-Identifier: MIT
/// Messages for people, on stderr. Never waits: what stderr does not take at once is dropped and counted, and so is
/// what comes faster than people read (40 lines at once, then 5 a second). The next line that passes tells how many
/// were dropped. Lines are plain (iwheel_northbound/text.h), whatever stands in their arguments.
#ifndef GATEWAY_LOG_H
#define GATEWAY_LOG_H

#include "iwheel/types.h"

typedef enum { GW_LOG_ERROR = 0, GW_LOG_WARNING, GW_LOG_INFO, GW_LOG_DEBUG, GW_LOG_LEVELS } gw_log_level_t;

typedef struct gw_log {
    const char *program;    ///< Whose lines they are; iwheel-gateway, unless changed after opening.
    iw_time_us_t credit_us; ///< Tokens were last added then.
    uint32_t credit;        ///< Lines that may still pass.
    uint32_t dropped;
    int fd;      ///< Of its own file description where possible, so that O_NONBLOCK is nobody else's.
    bool socket; ///< Sent instead of written.
    gw_log_level_t level;
} gw_log_t;

void gw_log_open(gw_log_t *self, gw_log_level_t level);
void gw_log_close(gw_log_t *self);

__attribute__((format(printf, 3, 4))) void gw_log(gw_log_t *self, gw_log_level_t level, const char *format, ...);

/// False if the word is none of error, warning, info, debug.
bool gw_log_level_of(const char *word, gw_log_level_t *out_level);

#endif
