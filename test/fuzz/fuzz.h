// SPDX-License-Identifier: MIT
/// What the fuzz targets share: libFuzzer's entry, bytes taken one after the other, and a way to fail.
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

/// A property does not hold: libFuzzer keeps the input.
static inline void fuzz_require(bool holds, const char *what) {
    if (!holds) {
        (void)fprintf(stderr, "does not hold: %s\n", what);
        abort();
    }
}

/// Says what became of the input where IWHEEL_FUZZ_TELL is set: test/fuzz/run learns so whether a seed is taken.
static inline void fuzz_tell(const char *what) {
    static int tells = -1;
    if (tells < 0) {
        tells = (getenv("IWHEEL_FUZZ_TELL") != NULL) ? 1 : 0;
    }
    if (tells == 1) {
        (void)fprintf(stderr, "told: %s\n", what);
    }
}

#endif
