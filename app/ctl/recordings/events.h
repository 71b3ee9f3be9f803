// SPDX-License-Identifier: MIT
/// File next to the frames of a recording: the stop, the requests, the port's answers, the decisions; one JSON object
/// per line.
#ifndef EVENTS_H
#define EVENTS_H

#include "blackbox_entry.h"

#include <jansson.h>
#include <stdio.h>

typedef struct {
    FILE *file;
    const char *name;
    char *line; ///< Buffer of getline; owned.
    size_t line_size;
    uint64_t number; ///< Number of the last line read.
    uint64_t bad;
    json_t *head;  ///< First line; owned.
    json_t *why;   ///< Second line, the stop; owned. May be NULL.
    bool whole;    ///< The last line has been read.
    uint64_t lost; ///< Entries that are missing.
} events_t;

/// Reads the head of `file`, which events_close closes. `file` is NULL, with errno, if there is none. Returns false
/// with errno; EPROTO: not such a file, which has been reported. `path` is its name in messages.
bool events_open(events_t *self, const char *path, FILE *file);
void events_close(events_t *self);

/// Returns true with the next entry and the number of frames before it; returns false at the end. Bad lines are
/// reported with their number and left out.
bool events_next(events_t *self, blackbox_entry_t *out_entry, uint64_t *out_frames);

#endif
