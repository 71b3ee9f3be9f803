// SPDX-License-Identifier: MIT
/// Log on stderr. It never waits: a line that stderr does not accept immediately is dropped and counted, and so are
/// lines beyond 40 together and 5 per second. The next line that is written reports the number. Lines have plain
/// characters only (iwheel_northbound/text.h), whatever their arguments contain.
#ifndef GATEWAY_LOG_H
#define GATEWAY_LOG_H

#include "iwheel/types.h"

/// Severity, most severe first.
typedef enum { SOCK_LOG_ERROR = 0, SOCK_LOG_WARNING, SOCK_LOG_INFO, SOCK_LOG_DEBUG, SOCK_LOG_LEVELS } sock_log_level_t;

/// A log. Only the functions below use its members, except `program` and `level`, which the owner may change. One log
/// belongs to one thread.
typedef struct sock_log {
    const char *program;    ///< Program name of the lines: iwheel-gateway, unless changed after opening.
    iw_time_us_t credit_us; ///< Time at which tokens were last added.
    uint32_t credit;        ///< Number of lines that may still be written.
    uint32_t dropped;       ///< Lines dropped since the last line that was written.
    int fd;      ///< With a file description of its own where possible, so that O_NONBLOCK affects no other process.
    bool socket; ///< Lines are sent instead of written.
    sock_log_level_t level; ///< Least severe level that is written.
} sock_log_t;

/// Opens stderr for lines up to `level`. It cannot fail: without a file description of its own it uses stderr itself.
void sock_log_open(sock_log_t *self, sock_log_level_t level);

/// Closes the descriptor that `sock_log_open` opened. The log stays usable: it then writes to stderr itself.
void sock_log_close(sock_log_t *self);

/// Writes one line "PROGRAM: LEVEL: text", cut if it is too long. `format` as in printf, without a newline.
__attribute__((format(printf, 3, 4))) void sock_log(sock_log_t *self, sock_log_level_t level, const char *format, ...);

/// Parses a level: error, warning, info or debug. For any other word it returns false and leaves `*out_level`
/// unchanged.
bool sock_log_level_of(const char *word, sock_log_level_t *out_level);

#endif
