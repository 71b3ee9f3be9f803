// SPDX-License-Identifier: MIT
#include "similar.h"

#include <string.h>

#define LETTERS_MAX   40U
#define BEGINNING_MIN 3U
#define DISTANCE_MAX  3U

static size_t least(size_t a, size_t b) {
    return (a < b) ? a : b;
}

/// Levenshtein distance. `width` is the length of `b`, at most LETTERS_MAX.
static size_t distance(const char *a, const char *b, size_t width) {
    size_t row[LETTERS_MAX + 1U];
    for (size_t j = 0; j <= width; j++) {
        row[j] = j;
    }
    for (size_t i = 0; a[i] != '\0'; i++) {
        size_t diagonal = row[0];
        row[0] = i + 1U;
        for (size_t j = 0; j < width; j++) {
            const size_t above = row[j + 1U];
            row[j + 1U] = least(diagonal + ((a[i] != b[j]) ? 1U : 0U), 1U + least(above, row[j]));
            diagonal = above;
        }
    }
    return row[width];
}

size_t settings_word_distance(const char *typed, const char *known) {
    const size_t length = strlen(typed);
    const size_t width = strlen(known);
    if (length >= BEGINNING_MIN && strncmp(known, typed, length) == 0) {
        return 0;
    }
    if (length > LETTERS_MAX || width > LETTERS_MAX) {
        return SETTINGS_WORD_STRANGE;
    }
    const size_t far = distance(typed, known, width);
    return (far <= DISTANCE_MAX && 2U * far <= width) ? far : SETTINGS_WORD_STRANGE;
}
