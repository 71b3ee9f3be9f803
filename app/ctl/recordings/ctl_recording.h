// SPDX-License-Identifier: MIT
/// A recording named on the command line: a file, or `-` for standard input; read frame by frame. Lines that cannot be
/// understood are told on stderr with file, line, cause and cure, the first of them; the rest is counted.
///
/// A file of a recording is read where it lies or, if it is not there or may not be read, fetched from the gateway, which reads it
/// for whoever may ask it. Only a file whose name is one of the gateway's own recordings is asked for, by that name alone; the
/// folder before it is ours.
#ifndef CTL_RECORDING_H
#define CTL_RECORDING_H

#include "candump_reader.h"
#include "talk/ctl.h"
#include "talk/ctl_words.h"

#include "iwheel/config.h"

#include <stdio.h>

/// Bad lines told one by one.
#define RECORDING_TOLD_MAX 10U

typedef struct {
    const char *name;     ///< As shown in messages.
    const char *only;     ///< Frames of this interface alone (option --interface); NULL: of the only one.
    bool every_interface; ///< Frames of every interface, each with its name. Set before the first frame, as the next.
    bool even;            ///< Times without the steps of a clock that was set; frames keep their order.
    bool refused;         ///< Another form, or several interfaces: the cause and the fix were printed.
    uint64_t frames;
    uint64_t bad;
    uint64_t others;       ///< Frames of interfaces that were not chosen.
    uint64_t steps;        ///< The clock was set.
    uint64_t wrong_stamps; ///< A single time far from its neighbours.
    uint64_t first_step;   ///< Line of the first of them.
    int64_t shift_us;      ///< Added to times as they stand there.
    int64_t last_us;       ///< Of the frame before, after the shift.
    candump_t pending;     ///< Read ahead.
    bool has_pending;
    char interface[CANDUMP_INTERFACE_SIZE];
    int fd;
    candump_reader_t reader;
} recording_t;

/// Opens it. `only`, `every_interface` and `even` stay as the caller has set them. An exit code, 0 for success; what is wrong has been told. `ctl`: to ask the gateway; NULL: files only.
int recording_open(recording_t *self, ctl_t *ctl, const char *path);

/// True with the next frame.
bool recording_next(recording_t *self, candump_t *out_frame);

/// True if the next frame must be waited for.
bool recording_is_drained(const recording_t *self);

/// Closes it. 0; CTL_DATA if there were bad lines (their number has been told), or no frame at all; another code if it could
/// not be read to its end.
int recording_close(recording_t *self);

// --- its files, wherever they lie --------------------------------------------------------------------------------

/// Bytes wanted of a file, all of them.
#define SOURCE_WHOLE INT64_MAX

/// Opens it (with a NULL `ctl`: where it lies only) for reading, close-on-exec. What is fetched is whole and checked, or, if only
/// the first `most` bytes are wanted, at least these; it lies in memory. -1 with errno as of open(), if the gateway does not have
/// it either, or cannot be asked.
int source_open(ctl_t *ctl, const char *path, int64_t most);

/// The same as a stream. NULL with errno.
FILE *source_stream(ctl_t *ctl, const char *path, int64_t most);

/// What the gateway has recorded: the reply to `recordings`, a new reference. NULL: it is not there, or refuses.
json_t *source_list(ctl_t *ctl);

// --- the option --config FILE of the verbs that read recordings --------------------------------------------------

/// Reads the gateway's configuration at `path` into the iw_config_t of the option. An exit code; what is wrong has been told.
int config_option_load(const option_t *option, const char *verb, const char *path);

/// The same of a file that is open, which it closes; `path` is its name in messages.
int config_option_take(const char *path, int fd, iw_config_t *out_config);

#endif
