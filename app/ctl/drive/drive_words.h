// SPDX-License-Identifier: MIT
/// The words of `drive`: LEFT RIGHT [--for TIME] [--current LEFT RIGHT] [--takeover].
#ifndef DRIVE_WORDS_H
#define DRIVE_WORDS_H

#include "text/duration.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DRIVE_TIME_MIN_MS     20
#define DRIVE_TIME_MAX_MS     600000
#define DRIVE_TIME_DEFAULT_MS 2000
#define DRIVE_CURRENT_MAX_mA  2000

typedef struct {
    int speed_mm_s[2];
    int current_mA[2];
    int time_ms;
    bool has_current;
    bool takeover;
} drive_words_t;

/// Size of `out_why`.
#define DRIVE_WHY_SIZE DURATION_WHY_SIZE

/// Reads the words. If they are not a valid drive command, returns false, leaves `*out_drive` unchanged, and writes the
/// mistake and its fix to `out_why`.
bool drive_words_parse(int count, char **words, drive_words_t *out_drive, char *out_why);

#endif
