// SPDX-License-Identifier: MIT
/// A mutator for inputs that are sequences of units, such as frames, lines or requests. It removes, doubles, swaps, moves and joins
/// units, and changes bytes within one, so most of its inputs are still acceptable. One file of each program includes it and
/// defines its units.
#ifndef FUZZ_SEQUENCE_H
#define FUZZ_SEQUENCE_H

#include "fuzz.h"

#define FUZZ_UNITS_MAX 4096U
#define FUZZ_ROOM      65536U

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t max_size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned int seed);
size_t LLVMFuzzerCustomCrossOver(const uint8_t *one, size_t one_size, const uint8_t *other, size_t other_size,
                                 uint8_t *out, size_t max_size, unsigned int seed);

/// Returns the length of the unit that begins there: 1 to size; size >= 1.
static size_t fuzz_unit(const uint8_t *data, size_t size);

static uint32_t fuzz_chance(unsigned int *seed, uint32_t limit) {
    *seed = *seed * 1664525U + 1013904223U;
    return (uint32_t)((uint64_t)(*seed >> 8) * limit >> 24);
}

/// Writes where each unit begins, and as the last entry where the last unit ends. Returns their number.
static size_t fuzz_units(const uint8_t *data, size_t size, size_t begin[FUZZ_UNITS_MAX + 1U]) {
    size_t count = 0;
    size_t at = 0;
    while (at < size && count < FUZZ_UNITS_MAX) {
        begin[count++] = at;
        at += fuzz_unit(&data[at], size - at);
    }
    begin[count] = at;
    return count;
}

static size_t fuzz_put(uint8_t *out, size_t length, size_t max_size, const uint8_t *bytes, size_t size) {
    const size_t copied = (size < max_size - length) ? size : max_size - length;
    memcpy(&out[length], bytes, copied);
    return length + copied;
}

/// Writes the units of `old` with one left out, doubled, or with `other` before it.
static size_t fuzz_rearrange(uint8_t *out, size_t max_size, const uint8_t *old, const size_t *begin, size_t count,
                             unsigned int *seed) {
    const size_t one = fuzz_chance(seed, (uint32_t)count);
    const size_t other = fuzz_chance(seed, (uint32_t)count);
    const uint32_t how = fuzz_chance(seed, 4);
    size_t length = 0;
    for (size_t i = 0; i < count; i++) {
        const size_t unit = (how == 3U && i == one) ? other : (how == 3U && i == other) ? one : i;
        const size_t size = begin[unit + 1U] - begin[unit];
        if (how == 2U && i == one) {
            length = fuzz_put(out, length, max_size, &old[begin[other]], begin[other + 1U] - begin[other]);
        }
        for (unsigned times = (i == one && how == 0U) ? 0U : (i == one && how == 1U) ? 2U : 1U; times > 0U; times--) {
            length = fuzz_put(out, length, max_size, &old[begin[unit]], size);
        }
    }
    return length;
}

/// Changes some bytes of one unit.
static size_t fuzz_within(uint8_t *out, size_t max_size, const uint8_t *old, const size_t *begin, size_t count,
                          unsigned int *seed) {
    static uint8_t unit[FUZZ_ROOM];
    const size_t one = fuzz_chance(seed, (uint32_t)count);
    const size_t size = begin[one + 1U] - begin[one];
    const size_t capacity = (size * 2U + 16U < sizeof unit) ? size * 2U + 16U : sizeof unit;
    memcpy(unit, &old[begin[one]], (size < capacity) ? size : capacity);
    const size_t changed = LLVMFuzzerMutate(unit, (size < capacity) ? size : capacity, capacity);
    size_t length = fuzz_put(out, 0, max_size, old, begin[one]);
    length = fuzz_put(out, length, max_size, unit, changed);
    return fuzz_put(out, length, max_size, &old[begin[one + 1U]], begin[count] - begin[one + 1U]);
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned int seed) {
    static uint8_t old[FUZZ_ROOM];
    static size_t begin[FUZZ_UNITS_MAX + 1U];
    unsigned int chance = seed;
    const size_t count = (size <= sizeof old) ? fuzz_units(data, size, begin) : 0U;
    const uint32_t what = fuzz_chance(&chance, 8);
    if (count == 0U || what < 4U) { // libFuzzer's own mutations for one half: they find faults of single bytes sooner.
        return LLVMFuzzerMutate(data, size, max_size);
    }
    memcpy(old, data, size);
    const size_t length = (what < 6U) ? fuzz_within(data, max_size, old, begin, count, &chance)
                                      : fuzz_rearrange(data, max_size, old, begin, count, &chance);
    return (length > 0U) ? length : fuzz_put(data, 0, max_size, old, size);
}

/// Joins the first units of one input and the last units of the other.
size_t LLVMFuzzerCustomCrossOver(const uint8_t *one, size_t one_size, const uint8_t *other, size_t other_size,
                                 uint8_t *out, size_t max_size, unsigned int seed) {
    static size_t begin[FUZZ_UNITS_MAX + 1U];
    unsigned int chance = seed;
    size_t count = fuzz_units(one, one_size, begin);
    const size_t length = fuzz_put(out, 0, max_size, one, begin[fuzz_chance(&chance, (uint32_t)count + 1U)]);
    count = fuzz_units(other, other_size, begin);
    const size_t from = begin[fuzz_chance(&chance, (uint32_t)count + 1U)];
    return fuzz_put(out, length, max_size, &other[from], other_size - from);
}

/// Defines units that end with that byte.
static inline size_t fuzz_until(const uint8_t *data, size_t size, uint8_t end) {
    const uint8_t *at = memchr(data, end, size);
    return (at != NULL) ? (size_t)(at - data) + 1U : size;
}

#endif
