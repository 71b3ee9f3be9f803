// SPDX-License-Identifier: MIT
/// Past stops, from the gateway or from recordings on disk. Private to why.
#ifndef CTL_WHY_H
#define CTL_WHY_H

#include "candump.h"
#include "talk/ctl.h"

#include <stddef.h>

/// Default directory of the gateway's recordings.
#define WHY_DISK_DIRECTORY "/var/lib/iwheel"
/// Maximum number of frames before and after the stop that the gateway stores.
#define WHY_FRAMES_MAX 40U

// --- on disk: from the files or, if they may not be read, from the gateway (why_disk.c) ----------------------------

typedef struct {
    ctl_t *ctl; ///< To ask the gateway if the files cannot be read; NULL: files only.
    const char *directory;
    bool json;
} why_disk_t;

/// Prints one line per recording in the directory, the newest last. With `json`: the recording's own line. Returns an
/// exit code; what is wrong has been reported.
int why_disk_list(const why_disk_t *self);

/// Prints the stop of a recording with `frames` frames before and after it. `name` is its number in the directory, or
/// the path of one of its files. Returns an exit code.
int why_disk_show(const why_disk_t *self, const char *name, size_t frames);

// --- text output for the gateway's answer and for a recording on disk (verb_why.c) --------------------------------

/// Prints sentence and time of `why`, which is a reply or the line of a recording. Returns false after it has printed
/// that there was no stop.
bool why_print_stop(const json_t *why);

/// Prints one frame, `since_us` after the stop (negative: before).
void why_print_frame(const candump_t *frame, int64_t since_us);

/// Prints the line between the frames before and after.
void why_print_moment(void);

#endif
