// SPDX-License-Identifier: MIT
/// A recording read line by line from a file or pipe of any length, in constant memory, and never waiting for more than
/// the next line. Nothing is lost: a line that cannot be understood is told with its number, and the next one is read.
#ifndef CANDUMP_READER_H
#define CANDUMP_READER_H

#include "candump.h"

/// A longer line is told as bad, once.
#define CANDUMP_READ_MAX 1024U

typedef enum {
    CANDUMP_READ_FRAME = 0,
    CANDUMP_READ_BAD,     ///< `line` and `why` tell where and what.
    CANDUMP_READ_FOREIGN, ///< Not in candump's log form: `why` names form and converter. Then CANDUMP_READ_END.
    CANDUMP_READ_END,
    CANDUMP_READ_FAILED, ///< errno tells why the file cannot be read.
} candump_read_t;

typedef struct {
    uint64_t line; ///< Number of the last line read; the first is 1.
    const char *why;
    size_t begin; ///< Unread bytes are [begin, end) of `buffer`.
    size_t end;
    int fd;
    bool begun; ///< The first bytes were compared with the forms of other programs.
    bool ended;
    bool failed;
    char buffer[65536];
} candump_reader_t;

void candump_reader_init(candump_reader_t *self, int fd);

/// The next frame or bad line; blank lines and comments are passed over. A last line without its line end may be cut,
/// and a frame cut in its data looks like a shorter one: it is told as bad.
candump_read_t candump_reader_next(candump_reader_t *self, candump_t *out_frame);

#endif
