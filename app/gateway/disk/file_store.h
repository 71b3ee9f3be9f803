// SPDX-License-Identifier: MIT
/// A process of its own that reads and writes one small file, so that no disk, however slow or full, holds up the
/// loop.
///
///     gateway --text--> keeper: written beside the file, flushed to the disk, renamed over it
///     gateway <--news-- keeper: what was found at the start; what became of each write
///
/// Nothing in the gateway waits: a text goes whole or not at all, news are looked for when the loop comes by.
#ifndef GATEWAY_FILE_STORE_H
#define GATEWAY_FILE_STORE_H

#include "process/child.h"

/// The longest text that is kept or read.
#define GW_FILE_STORE_TEXT_MAX 16384U
/// And the byte before it.
#define GW_FILE_STORE_MESSAGE_MAX (1U + GW_FILE_STORE_TEXT_MAX)
#define GW_FILE_STORE_NAME_SIZE   288U

typedef enum {
    GW_FILE_STORE_NO_NEWS = 0,
    GW_FILE_STORE_READ,    ///< The file's text. First news only, like the next two; or it is FAILED: no directory.
    GW_FILE_STORE_ABSENT,  ///< There is no file.
    GW_FILE_STORE_BAD,     ///< Not to be read, or no ordinary file, or too long.
    GW_FILE_STORE_WRITTEN, ///< The last text is on the disk.
    GW_FILE_STORE_FAILED,  ///< It is not; the file is as it was.
    GW_FILE_STORE_GONE,    ///< The keeper itself has ended. Last news.
} gw_file_store_news_t;

typedef struct {
    gw_child_t child;
    const char *directory;
    char name[GW_FILE_STORE_NAME_SIZE];
    bool waits;                              ///< News are owed.
    char message[GW_FILE_STORE_MESSAGE_MAX]; ///< Said or heard last.
} gw_file_store_t;

/// Starts the keeper of DIRECTORY/NAME and lets it read. 0, or an errno. `directory` must outlive it.
int gw_file_store_open(gw_file_store_t *self, const char *directory, const char *name);

/// Hands over a text to be kept. False if the keeper cannot take it now: it is busy, or gone.
bool gw_file_store_write(gw_file_store_t *self, const char *text, size_t length);

/// Asks that the present file be renamed to NAME.damaged before the next text is written.
void gw_file_store_set_aside(gw_file_store_t *self);

/// The next news, if there are any. `*out_text` and `*out_length` are written with GW_FILE_STORE_READ: it stays until
/// the next call. `*out_error` is an errno, or a reason of owners.h, with GW_FILE_STORE_BAD and GW_FILE_STORE_FAILED.
gw_file_store_news_t gw_file_store_receive(gw_file_store_t *self, const char **out_text, size_t *out_length,
                                           int *out_error);

void gw_file_store_close(gw_file_store_t *self);

#endif
