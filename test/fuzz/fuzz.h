// SPDX-License-Identifier: MIT
/// Shared by all fuzz targets: libFuzzer's entry, a reader of single bytes, and a check that can fail.
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

typedef struct {
    const uint8_t *data;
    size_t size;
    size_t at;
} fuzz_bytes_t;

/// The next byte; 0 when there is none left.
static inline uint8_t fuzz_byte(fuzz_bytes_t *bytes) {
    return (bytes->at < bytes->size) ? bytes->data[bytes->at++] : 0U;
}

static inline uint16_t fuzz_word(fuzz_bytes_t *bytes) {
    const unsigned high = fuzz_byte(bytes);
    return (uint16_t)(high << 8 | fuzz_byte(bytes));
}

/// Fails if a property does not hold; libFuzzer then stores the input.
static inline void fuzz_require(bool holds, const char *what) {
    if (!holds) {
        (void)fprintf(stderr, "does not hold: %s\n", what);
        abort();
    }
}

/// Prints the result of the input if IWHEEL_FUZZ_TELL is set: test/fuzz/run checks with it that a seed is accepted.
static inline void fuzz_position(const char *what) {
    static int prints = -1;
    if (prints < 0) {
        prints = (getenv("IWHEEL_FUZZ_TELL") != NULL) ? 1 : 0;
    }
    if (prints == 1) {
        (void)fprintf(stderr, "input: %s\n", what);
    }
}

#endif
