// SPDX-License-Identifier: MIT
/// The recordings in the record directory: numbered, few, and made of three files each. Only names of our own form are ever
/// removed.
#ifndef GATEWAY_BOX_FILES_H
#define GATEWAY_BOX_FILES_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#define GW_BOX_STEM_SIZE 64U

/// Opens the directory, made if only its last part is missing. A descriptor, or -1 with errno
/// or a reason of owners.h in it.
int gw_box_files_open(const char *directory);

/// The number after the highest there is.
uint32_t gw_box_files_next(int directory);

/// Removes the oldest recordings until no more than `most` with no more than `bytes` are left.
void gw_box_files_rotate(int directory, uint32_t most, uint64_t bytes);

/// Removes the oldest recording below `number`. False if there is none.
bool gw_box_files_drop_oldest(int directory, uint32_t number);

/// Removes all files of that recording.
void gw_box_files_remove(int directory, uint32_t number);

/// A new file STEM + `ending`, not yet there. NULL with errno.
FILE *gw_box_files_create(int directory, const char *stem, const char *ending);

#endif
