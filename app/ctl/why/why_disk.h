// SPDX-License-Identifier: MIT
/// The stops that the gateway has recorded on disk. Needs no gateway.
#ifndef WHY_DISK_H
#define WHY_DISK_H

#include <stdbool.h>
#include <stddef.h>

/// Where the gateway records if nobody tells otherwise.
#define WHY_DISK_DIRECTORY "/var/lib/iwheel"

/// One line per recording in that directory, the newest last. With `json`: the recording's own line. An exit code; what is
/// wrong has been told.
int why_disk_list(const char *directory, bool json);

/// The stop of a recording with `frames` frames on either side. `name`: its number in the directory, or the path of one of
/// its files. An exit code.
int why_disk_show(const char *directory, const char *name, size_t frames, bool json);

#endif
