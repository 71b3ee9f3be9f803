// SPDX-License-Identifier: MIT
/// The file beside the frames of a recording: the stop, the requests, the port's answers, the decisions; one JSON object per line.
#ifndef EVENTS_H
#define EVENTS_H

#include "blackbox_entry.h"

#include <jansson.h>
#include <stdio.h>

typedef struct {
    FILE *file;
    const char *name;
    char *line; ///< Owned; of getline.
    size_t line_size;
    uint64_t number; ///< Of the last line read.
    uint64_t bad;
    json_t *head;  ///< The first line; owned.
    json_t *why;   ///< The second: the stop; owned. May be NULL.
    bool whole;    ///< The last line has been seen.
    uint64_t lost; ///< Entries that are missing.
} events_t;

/// Reads the head of `file`, which it closes later; NULL, with errno: there is none. False with errno; EPROTO: it is none of ours, which
/// has been told. `path` is its name in messages.
bool events_open(events_t *self, const char *path, FILE *file);
void events_close(events_t *self);

/// The next entry, and how many frames stand before it. Bad lines are told with their number and left out. False: the
/// end.
bool events_next(events_t *self, blackbox_entry_t *out_entry, uint64_t *out_frames);

#endif
