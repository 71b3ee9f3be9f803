// SPDX-License-Identifier: MIT
/// The stops that the gateway has recorded on disk: from the files or, where they may not be read, from the gateway.
#ifndef WHY_DISK_H
#define WHY_DISK_H

#include "talk/ctl.h"

#include <stddef.h>

/// Where the gateway records if nobody tells otherwise.
#define WHY_DISK_DIRECTORY "/var/lib/iwheel"

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

#endif
