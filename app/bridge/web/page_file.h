// SPDX-License-Identifier: MIT
/// A file of the page in memory, plain and compressed, each with the tag by which a browser checks its copy.
#ifndef PAGE_FILE_H
#define PAGE_FILE_H

#include <stdbool.h>
#include <stddef.h>

/// Size of a tag with its quotes and terminator.
#define PAGE_TAG_SIZE 36U

typedef struct {
    char *text; ///< NULL: none.
    size_t length;
    char tag[PAGE_TAG_SIZE];
} page_body_t;

/// `packed` contains the same bytes as gzip, or nothing.
typedef struct {
    page_body_t plain;
    page_body_t packed;
} page_file_t;

/// Reads a whole file and adds a NUL. The caller frees it. Returns NULL if it cannot be read.
char *page_read_all(const char *path, size_t *out_length);

/// Reads the file and `path`.gz, which is ignored if it was made of other bytes. Returns false if the file cannot be
/// read.
bool page_file_read(page_file_t *self, const char *path);
void page_file_free(page_file_t *self);

/// Returns the body for a client with this header Accept-Encoding (NULL: not sent).
const page_body_t *page_file_choose(const page_file_t *self, const char *accepted);

/// Returns true if this header If-None-Match (NULL: not sent) names the body: the copy of the browser is current.
bool page_body_is_known(const page_body_t *self, const char *known);

#endif
