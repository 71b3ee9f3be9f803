// SPDX-License-Identifier: MIT
/// The form of a recording that is not candump's log form, by its first bytes.
///
/// Pure functions; no byte is read beyond `size`.
#ifndef CANDUMP_FORM_H
#define CANDUMP_FORM_H

#include <stddef.h>

/// Bytes of the UTF-8 byte order mark at the begin, which some editors write: 3, or 0 if there is none.
size_t candump_form_mark(const char *bytes, size_t size);

/// Names a form of another program and the command that converts it, in one sentence without a period. `size`: at least the first line, if the
/// file has one in its first 1024 bytes. NULL: none of the known ones, read it line by line.
const char *candump_form_foreign(const char *bytes, size_t size);

#endif
