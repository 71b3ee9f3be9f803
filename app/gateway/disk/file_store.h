// SPDX-License-Identifier: MIT
/// Store process: a separate process that reads and writes one small file, so that no slow or full disk delays the
/// loop.
///
///     gateway --text--> store process: writes it to a new file, flushes it to the disk, renames it
///     gateway <--news-- store process: contents of the file at the start; result of each write
///
/// Store processes lock the directory: the first news contain the last text of an earlier gateway whose store process
/// still writes. They come at most 10 s late because of it.
///
/// The gateway never waits: it passes a text as a whole or not at all, and polls for news in the loop.
#ifndef GATEWAY_FILE_STORE_H
#define GATEWAY_FILE_STORE_H

#include "process/child.h"

/// Longest text that is stored or read.
#define GW_FILE_STORE_TEXT_MAX 16384U
/// Size of a text and the byte before it.
#define GW_FILE_STORE_MESSAGE_MAX (1U + GW_FILE_STORE_TEXT_MAX)
#define GW_FILE_STORE_NAME_SIZE   288U

typedef enum {
    GW_FILE_STORE_NO_NEWS = 0,
    GW_FILE_STORE_READ,    ///< Text of the file. First news only, like the next two; or FAILED: no directory.
    GW_FILE_STORE_ABSENT,  ///< The file does not exist.
    GW_FILE_STORE_BAD,     ///< The file cannot be read, is not a regular file, or is too long.
    GW_FILE_STORE_WRITTEN, ///< The last text is on the disk.
    GW_FILE_STORE_FAILED,  ///< The last text is not on the disk; the file is unchanged.
    GW_FILE_STORE_GONE,    ///< The store process has ended. Last news.
} gw_file_store_news_t;

typedef struct {
    gw_child_t child;
    const char *directory;
    char name[GW_FILE_STORE_NAME_SIZE];
    bool waits;                              ///< News are expected.
    char message[GW_FILE_STORE_MESSAGE_MAX]; ///< Last sent or received message.
} gw_file_store_t;

/// Starts the store process of DIRECTORY/NAME, which reads the file. Returns 0 or an errno. `directory` must exist as
/// long as `self`.
int gw_file_store_open(gw_file_store_t *self, const char *directory, const char *name);

/// Passes a text to store. Returns false if the process cannot accept it now: it is busy, or has ended.
bool gw_file_store_write(gw_file_store_t *self, const char *text, size_t length);

/// Requests that the present file be renamed to NAME.damaged before the next text is written.
void gw_file_store_set_aside(gw_file_store_t *self);

/// Returns the next news, if there are any. With GW_FILE_STORE_READ, `*out_text` and `*out_length` are valid until the
/// next call. With GW_FILE_STORE_BAD and GW_FILE_STORE_FAILED, `*out_error` is an errno or a reason of owners.h.
gw_file_store_news_t gw_file_store_receive(gw_file_store_t *self, const char **out_text, size_t *out_length,
                                           int *out_error);

void gw_file_store_close(gw_file_store_t *self);

#endif
