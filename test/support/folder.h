// SPDX-License-Identifier: MIT
/// A folder for the files of one test, and files at any path.
#ifndef TEST_FOLDER_H
#define TEST_FOLDER_H

#include <stdbool.h>
#include <stddef.h>

/// Path of the folder in /tmp.
extern char folder[];

/// Makes a new, empty folder, for setUp.
void folder_make(void);

/// Removes it with all its files, and the one in memory, for tearDown.
void folder_remove(void);

/// Returns the path of this file of the folder. The next call overwrites it.
char *in_folder(const char *name);

/// Returns the path of a second folder, in memory, for a test with many files. The test makes it.
const char *folder_in_memory(void);

/// Writes a new file with these bytes.
void file_put(const char *path, const void *bytes, size_t length);

/// Returns the content of a file, terminated. The next call overwrites it.
const char *file_text(const char *path);

bool file_exists(const char *path);

/// Returns how many entries of the directory have a name with this prefix, not counting "." and "..".
unsigned files_in(const char *directory, const char *prefix);

#endif
