// SPDX-License-Identifier: MIT
/// A recording named on the command line: a file, or `-` for standard input; read frame by frame. Lines that cannot be
/// understood are told on stderr with file, line, cause and cure, the first of them; the rest is counted.
#ifndef RECORDING_H
#define RECORDING_H

#include "candump_reader.h"

/// Bad lines told one by one.
#define RECORDING_TOLD_MAX 10U

typedef struct {
    const char *name; ///< As shown in messages.
    uint64_t frames;
    uint64_t bad;
    int fd;
    candump_reader_t reader;
} recording_t;

/// Opens it. An exit code, 0 for success; what is wrong has been told.
int recording_open(recording_t *self, const char *path);

/// The same of a file that is open; it is closed with the recording. `path` is its name in messages.
int recording_take(recording_t *self, const char *path, int fd);

/// True with the next frame.
bool recording_next(recording_t *self, candump_t *out_frame);

/// True if the next frame must be waited for.
bool recording_is_drained(const recording_t *self);

/// Closes it. 0; CTL_DATA if there were bad lines (their number has been told), or no frame at all; another code if it could
/// not be read to its end.
int recording_close(recording_t *self);

#endif
