// SPDX-License-Identifier: MIT
/// A process of its own that reads and writes one small file, so that no disk, however slow or full, holds up the
/// loop.
///
///     gateway --text--> keeper: written beside the file, flushed to the disk, renamed over it
///     gateway <--news-- keeper: what was found at the start; what became of each write
///
/// Nothing in the gateway waits: a text goes whole or not at all, news are looked for when the loop comes by.
#ifndef GATEWAY_KEEPER_H
#define GATEWAY_KEEPER_H

#include "process/child.h"

/// The longest text that is kept or read.
#define GW_KEEPER_TEXT_MAX 16384U
/// And the byte before it.
#define GW_KEEPER_MESSAGE_MAX (1U + GW_KEEPER_TEXT_MAX)
#define GW_KEEPER_NAME_SIZE   288U

typedef enum {
    GW_KEEPER_NO_NEWS = 0,
    GW_KEEPER_READ,    ///< The file's text. First news only, like the next two; or it is FAILED: no directory.
    GW_KEEPER_ABSENT,  ///< There is no file.
    GW_KEEPER_BAD,     ///< Not to be read, or no ordinary file, or too long.
    GW_KEEPER_WRITTEN, ///< The last text is on the disk.
    GW_KEEPER_FAILED,  ///< It is not; the file is as it was.
    GW_KEEPER_GONE,    ///< The keeper itself has ended. Last news.
} gw_keeper_news_t;

typedef struct {
    gw_child_t child;
    const char *directory;
    char name[GW_KEEPER_NAME_SIZE];
    bool waits;                          ///< News are owed.
    char message[GW_KEEPER_MESSAGE_MAX]; ///< Said or heard last.
} gw_keeper_t;

/// Starts the keeper of DIRECTORY/NAME and lets it read. 0, or an errno. `directory` must outlive it.
int gw_keeper_open(gw_keeper_t *self, const char *directory, const char *name);

/// Hands over a text to be kept. False if the keeper cannot take it now: it is busy, or gone.
bool gw_keeper_write(gw_keeper_t *self, const char *text, size_t length);

/// Asks that the present file be renamed to NAME.damaged before the next text is written.
void gw_keeper_set_aside(gw_keeper_t *self);

/// The next news, if there are any. `*out_text` and `*out_length` are written with GW_KEEPER_READ: it stays until the
/// next call. `*out_error` is an errno, or a reason of owners.h, with GW_KEEPER_BAD and GW_KEEPER_FAILED.
gw_keeper_news_t gw_keeper_hear(gw_keeper_t *self, const char **out_text, size_t *out_length, int *out_error);

void gw_keeper_close(gw_keeper_t *self);

#endif
