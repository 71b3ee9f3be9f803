// SPDX-License-Identifier: MIT
/// A file of the page in memory, as it is and compressed, each with the tag by which a browser asks whether its copy is still good.
#ifndef PAGE_FILE_H
#define PAGE_FILE_H

#include <stdbool.h>
#include <stddef.h>

/// Bytes of a tag with its quotes and terminator.
#define PAGE_TAG_SIZE 36U

typedef struct {
    char *text; ///< NULL: there is none.
    size_t length;
    char tag[PAGE_TAG_SIZE];
} page_body_t;

/// `packed` holds the same bytes by gzip, or nothing.
typedef struct {
    page_body_t plain;
    page_body_t packed;
} page_file_t;

/// The whole file, ended by a NUL and to be freed; NULL: it cannot be read.
char *page_read_all(const char *path, size_t *out_length);

/// Reads the file and, next to it, `path`.gz. One that was made of other bytes is left out. False: the file cannot be read.
bool page_file_read(page_file_t *self, const char *path);
void page_file_free(page_file_t *self);

/// What to send to who accepts these encodings (a header Accept-Encoding; NULL: not sent).
const page_body_t *page_file_choose(const page_file_t *self, const char *accepted);

/// True if this header If-None-Match (NULL: not sent) names the body: the browser's copy is good.
bool page_body_is_known(const page_body_t *self, const char *known);

#endif
