// SPDX-License-Identifier: MIT
/// A folder for the files of one test.
#ifndef TEST_FOLDER_H
#define TEST_FOLDER_H

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

#endif
