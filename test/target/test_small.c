// SPDX-License-Identifier: MIT
// Compares small.c, under other names, with the library of this machine.
#include "unit.h"

#include <stdlib.h>
#include <string.h>

#define memcpy       small_memcpy
#define memmove      small_memmove
#define memset       small_memset
#define memcmp       small_memcmp
#define strlen       small_strlen
#define strncmp      small_strncmp
#define strcmp       small_strcmp
#define strchr       small_strchr
#define __udivmoddi4 small_divide
#include "small.c"
#undef memcpy
#undef memmove
#undef memset
#undef memcmp
#undef strlen
#undef strncmp
#undef strcmp
#undef strchr

#define SIZE 24U

static uint32_t state = 1;

static uint32_t roll(uint32_t below) {
    state = state * 1664525U + 1013904223U;
    return (state >> 8U) % below;
}

static int sign(int value) {
    return (value > 0) - (value < 0);
}

TEST(test_small_memory_functions_equal_the_library) {
    for (unsigned i = 0; i < 20000U; i++) {
        uint8_t mine[SIZE];
        uint8_t theirs[SIZE];
        for (size_t at = 0; at < SIZE; at++) {
            mine[at] = theirs[at] = (uint8_t)(roll(3) + 254U);
        }
        const size_t from = roll(SIZE / 2U);
        const size_t to = roll(SIZE / 2U);
        const size_t size = roll(SIZE / 2U + 1U);
        TEST_ASSERT_EQUAL_INT(sign(memcmp(mine + from, mine + to, size)),
                              sign(small_memcmp(mine + from, mine + to, size)));
        TEST_ASSERT_EQUAL_PTR(mine + to, small_memmove(mine + to, mine + from, size));
        memmove(theirs + to, theirs + from, size);
        TEST_ASSERT_EQUAL_UINT8_ARRAY(theirs, mine, SIZE);
        const uint8_t *const source = theirs; // Another array: memcpy's do not overlap.
        TEST_ASSERT_EQUAL_PTR(mine + to, small_memcpy(mine + to, source + from, size));
        memmove(theirs + to, theirs + from, size);
        TEST_ASSERT_EQUAL_UINT8_ARRAY(theirs, mine, SIZE);
        TEST_ASSERT_EQUAL_PTR(mine + from, small_memset(mine + from, (int)i, size));
        memset(theirs + from, (int)i, size);
        TEST_ASSERT_EQUAL_UINT8_ARRAY(theirs, mine, SIZE);
    }
}

TEST(test_small_string_functions_equal_the_library) {
    for (unsigned i = 0; i < 20000U; i++) {
        char texts[2][SIZE] = {{0}};
        for (size_t at = 0; at < SIZE - 1U; at++) {
            texts[0][at] = (char)("\0a\xE4"[roll(8) / 3U]);
            texts[1][at] = (char)("\0a\xE4"[roll(8) / 3U]);
        }
        const size_t size = roll(SIZE);
        TEST_ASSERT_EQUAL_size_t(strlen(texts[0]), small_strlen(texts[0]));
        TEST_ASSERT_EQUAL_INT(sign(strcmp(texts[0], texts[1])), sign(small_strcmp(texts[0], texts[1])));
        TEST_ASSERT_EQUAL_INT(sign(strncmp(texts[0], texts[1], size)), sign(small_strncmp(texts[0], texts[1], size)));
        for (int wanted = 0; wanted < 256; wanted += 25) {
            TEST_ASSERT_EQUAL_PTR(strchr(texts[0], wanted), small_strchr(texts[0], wanted));
        }
        TEST_ASSERT_EQUAL_PTR(strchr(texts[0], 0xE4), small_strchr(texts[0], 0xE4));
    }
}

TEST(test_small_division_equals_the_machine) {
    static const uint64_t corners[] = {
        0,         1,     2,          3,          10,          999,         1000,
        65535,     65536, 1000000000, UINT32_MAX, 1ULL << 32U, 1ULL << 63U, UINT64_MAX - 1U,
        UINT64_MAX};
    const size_t count = sizeof corners / sizeof corners[0];
    for (size_t i = 0; i < count * count; i++) {
        const uint64_t number = corners[i / count];
        const uint64_t divisor = corners[i % count];
        uint64_t rest = 7;
        const uint64_t quotient = small_divide(number, divisor, &rest);
        TEST_ASSERT_EQUAL_UINT64((divisor == 0U) ? 0U : number / divisor, quotient);
        TEST_ASSERT_EQUAL_UINT64((divisor == 0U) ? 0U : number % divisor, rest);
        TEST_ASSERT_EQUAL_UINT64(quotient, small_divide(number, divisor, NULL));
    }
}
