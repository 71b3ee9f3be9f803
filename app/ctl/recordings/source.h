// SPDX-License-Identifier: MIT
/// A file of a recording: read where it lies or, if it is not there or may not be read, fetched from the gateway, which reads it for
/// whoever may ask it.
///
/// Only a file whose name is one of the gateway's own recordings is asked for, by that name alone; the folder before it is ours.
#ifndef SOURCE_H
#define SOURCE_H

#include "talk/ctl.h"

#include <stdio.h>

/// Bytes wanted of a file, all of them.
#define SOURCE_WHOLE INT64_MAX

/// True if the last part of the path has the form of a recording's file.
bool source_is_ours(const char *path);

/// Opens it (with a NULL `ctl`: where it lies only) for reading, close-on-exec. What is fetched is whole and checked, or, if only the first `most` bytes are wanted, at least these; it
/// lies in memory. -1 with errno as of open(), if the gateway does not have it either, or cannot be asked.
int source_open(ctl_t *ctl, const char *path, int64_t most);

/// The same as a stream. NULL with errno.
FILE *source_stream(ctl_t *ctl, const char *path, int64_t most);

/// What the gateway has recorded: the reply to `recordings`, a new reference. NULL: it is not there, or refuses.
json_t *source_list(ctl_t *ctl);

#endif
