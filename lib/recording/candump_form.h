// SPDX-License-Identifier: MIT
/// Recognises the form of a recording that is not candump's log form, by its first bytes.
///
/// Pure functions; they read no byte beyond `size`.
#ifndef CANDUMP_FORM_H
#define CANDUMP_FORM_H

#include <stddef.h>

/// Returns the length of the UTF-8 byte order mark at the beginning, which some editors write: 3, or 0 if there is
/// none.
size_t candump_form_mark(const char *bytes, size_t size);

/// Recognises the form of another program and returns a sentence without a period that names it and the command that
/// converts it. `size`: at least the first line, if it ends within 1024 bytes. Returns NULL if the form is unknown;
/// then read it line by line.
const char *candump_form_foreign(const char *bytes, size_t size);

#endif
