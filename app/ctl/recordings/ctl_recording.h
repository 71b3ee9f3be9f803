// SPDX-License-Identifier: MIT
/// A recording named on the command line: a file, or `-` for standard input; it is read frame by frame. The first lines
/// that cannot be parsed are reported on stderr with file, line, cause and fix; the others are counted.
///
/// If a file of a recording does not exist or may not be read, it is fetched from the gateway, which reads it for every
/// client. Only a file with the name of one of the gateway's own recordings is requested, by this name alone; the
/// folder before it belongs to this machine.
#ifndef CTL_RECORDING_H
#define CTL_RECORDING_H

#include "candump_reader.h"
#include "talk/ctl.h"
#include "talk/ctl_words.h"

#include "iwheel/config.h"

#include <stdio.h>

/// Maximum number of bad lines that are reported one by one.
#define RECORDING_PRINTED_MAX 10U

typedef struct {
    const char *name;     ///< Name in messages.
    const char *only;     ///< Read only this interface (option --interface); NULL: the only one.
    bool every_interface; ///< Read all interfaces. Set it before the first frame, as the next.
    bool even;            ///< Remove the steps of a clock that was set; the order of frames stays.
    bool refused;         ///< Another format, or several interfaces: the cause and the fix were printed.
    uint64_t frames;
    uint64_t bad;
    uint64_t others;       ///< Frames of interfaces that were not chosen.
    uint64_t steps;        ///< Number of times that the clock was set.
    uint64_t wrong_stamps; ///< Number of single times that are far from their neighbours.
    uint64_t first_step;   ///< Line of the first of them.
    int64_t shift_us;      ///< Added to the times in the file.
    int64_t last_us;       ///< Time of the frame before, after the shift.
    candump_t pending;     ///< Frame that was read ahead.
    bool has_pending;
    char interface[CANDUMP_INTERFACE_SIZE];
    int fd;
    candump_reader_t reader;
} recording_t;

/// Opens a recording. The caller has set `only`, `every_interface` and `even`. `ctl` is used to ask the gateway; NULL:
/// files only. Returns an exit code, 0 for success; what is wrong has been reported.
int recording_open(recording_t *self, ctl_t *ctl, const char *path);

/// Returns true and writes the next frame; returns false at the end.
bool recording_next(recording_t *self, candump_t *out_frame);

/// Returns true if the next frame must be waited for.
bool recording_is_drained(const recording_t *self);

/// Closes the recording. Returns 0; CTL_DATA if there were bad lines (their number has been reported) or no frame at
/// all; another code if it could not be read to its end.
int recording_close(recording_t *self);

// --- files of a recording, local or from the gateway --------------------------------------------------------------

/// Number of wanted bytes that means the whole file.
#define SOURCE_WHOLE INT64_MAX

/// Opens the file for reading, close-on-exec; with a NULL `ctl`, only a local file. A fetched file is in memory; it is
/// whole and checked, or, if only the first `most` bytes are wanted, has at least these. Returns -1, with errno as of
/// open(), if the gateway does not have the file either or cannot be asked.
int source_open(ctl_t *ctl, const char *path, int64_t most);

/// Opens the file as source_open does, as a stream. Returns NULL, with errno, on failure.
FILE *source_stream(ctl_t *ctl, const char *path, int64_t most);

/// Returns the gateway's reply to `recordings`, a new reference; NULL if there is no gateway or it refuses.
json_t *source_list(ctl_t *ctl);

// --- the option --config FILE of the verbs that read recordings --------------------------------------------------

/// Reads the gateway's configuration at `path` into the iw_config_t of the option. Returns an exit code; what is wrong
/// has been reported.
int config_option_load(const option_t *option, const char *verb, const char *path);

/// Reads the configuration from an open file, which it closes; `path` is its name in messages.
int config_option_take(const char *path, int fd, iw_config_t *out_config);

#endif
