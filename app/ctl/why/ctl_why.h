// SPDX-License-Identifier: MIT
/// The stops that were: told by the gateway, or recorded on disk. Private to why.
#ifndef CTL_WHY_H
#define CTL_WHY_H

#include "candump.h"
#include "talk/ctl.h"

#include <stddef.h>

/// Where the gateway records if nobody tells otherwise.
#define WHY_DISK_DIRECTORY "/var/lib/iwheel"
/// Frames on either side that the gateway keeps at the most.
#define WHY_FRAMES_MAX 40U

// --- on disk: from the files or, where they may not be read, from the gateway (why_disk.c) -----------------------

typedef struct {
    ctl_t *ctl; ///< To ask the gateway where there are no files to be read; NULL: files only.
    const char *directory;
    bool json;
} why_disk_t;

/// One line per recording in that directory, the newest last. With `json`: the recording's own line. An exit code; what is
/// wrong has been told.
int why_disk_list(const why_disk_t *self);

/// The stop of a recording with `frames` frames on either side. `name`: its number in the directory, or the path of one of
/// its files. An exit code.
int why_disk_show(const why_disk_t *self, const char *name, size_t frames);

// --- for people: the same for the gateway's answer and for a recording on disk (verb_why.c) ---------------------

/// Sentence and time of `why`, which is a reply or the line of a recording. False: there was no stop, which has been said.
bool why_print_stop(const json_t *why);

/// One frame, `since_us` after the stop (negative: before).
void why_print_frame(const candump_t *frame, int64_t since_us);

/// The line between the frames before and after.
void why_print_moment(void);

#endif
