// SPDX-License-Identifier: MIT
/// Reads a recording line by line from a file or pipe of any length, in constant memory, and never waits for more than
/// the next line. A line that cannot be parsed is reported with its number, and reading continues.
#ifndef CANDUMP_READER_H
#define CANDUMP_READER_H

#include "candump.h"

/// A longer line is reported as bad once.
#define CANDUMP_READ_MAX 1024U

typedef enum {
    CANDUMP_READ_FRAME = 0,
    CANDUMP_READ_BAD,     ///< `line` and `why` have the place and the reason.
    CANDUMP_READ_FOREIGN, ///< Another form: `why` has the form and the converter. CANDUMP_READ_END follows.
    CANDUMP_READ_END,
    CANDUMP_READ_FAILED, ///< errno is the reason why the file cannot be read.
} candump_read_t;

/// State of the file, in this order.
typedef enum {
    CANDUMP_NEW = 0, ///< The first bytes were not yet compared with the forms of other programs.
    CANDUMP_OPEN,
    CANDUMP_ENDED, ///< All bytes are in `buffer`.
    CANDUMP_BROKEN ///< The same, because a read failed.
} candump_source_t;

typedef struct {
    uint64_t line; ///< Number of the last line; the first is 1.
    const char *why;
    size_t begin; ///< The unread bytes are [begin, end) of `buffer`.
    size_t end;
    int fd;
    candump_source_t source;
    char buffer[65536];
} candump_reader_t;

void candump_reader_init(candump_reader_t *self, int fd);

/// Returns the next frame or bad line; skips blank lines and comments. A last line without line end may be cut, and a
/// frame that is cut in its data equals a shorter one, so it is reported as bad.
candump_read_t candump_reader_next(candump_reader_t *self, candump_t *out_frame);

#endif
