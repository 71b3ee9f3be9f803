// SPDX-License-Identifier: MIT
#include "blackbox_ring.h"

#include <stdlib.h>
#include <string.h>
#include <unity.h>

static blackbox_ring_t *ring;
static blackbox_entry_t out[3U * BLACKBOX_ENTRIES_PER_S];

void setUp(void) {
    const size_t size = blackbox_ring_size(1);
    ring = (blackbox_ring_t *)malloc(size);
    TEST_ASSERT_NOT_NULL(ring);
    memset(ring, 0xA5, size);
    blackbox_ring_init(ring, 1);
}

void tearDown(void) {
    free(ring);
}

static void put(uint64_t from, uint64_t to) {
    for (uint64_t i = from; i < to; i++) {
        const blackbox_entry_t entry = {.at_us = i, .number = (uint32_t)i, .kind = BLACKBOX_FRAME};
        blackbox_ring_put(ring, &entry);
    }
}

static void expect(uint64_t from, uint64_t to, uint64_t first, size_t count) {
    size_t got;
    TEST_ASSERT_EQUAL_UINT64(first, blackbox_ring_copy(ring, from, to, out, &got));
    TEST_ASSERT_EQUAL_size_t(count, got);
    for (size_t i = 0; i < got; i++) {
        TEST_ASSERT_EQUAL_UINT64(first + i, out[i].at_us);
    }
}

static void test_empty_ring_has_nothing(void) {
    expect(0, UINT64_MAX, 0, 0);
    TEST_ASSERT_EQUAL_UINT64(0, blackbox_ring_written(ring));
}

static void test_entries_come_back_in_order(void) {
    put(0, 10);
    expect(0, 10, 0, 10);
    expect(3, 7, 3, 4);
    expect(0, UINT64_MAX, 0, 10);
    expect(10, UINT64_MAX, 10, 0);
}

static void test_overwritten_entries_are_missing_and_nothing_else(void) {
    put(0, BLACKBOX_ENTRIES_PER_S + 100U);
    // The slot that will be written next counts as overwritten: the writer may be at it.
    expect(0, UINT64_MAX, 101, BLACKBOX_ENTRIES_PER_S - 1U);
    expect(50, 90, 101, 0);
    expect(50, 110, 101, 9);
}

static void test_full_ring_keeps_all_but_the_slot_to_come(void) {
    put(0, BLACKBOX_ENTRIES_PER_S - 1U);
    expect(0, UINT64_MAX, 0, BLACKBOX_ENTRIES_PER_S - 1U);
    put(BLACKBOX_ENTRIES_PER_S - 1U, BLACKBOX_ENTRIES_PER_S);
    expect(0, UINT64_MAX, 1, BLACKBOX_ENTRIES_PER_S - 1U);
}

static void test_size_follows_the_seconds_and_has_a_least(void) {
    TEST_ASSERT_EQUAL_size_t(sizeof *ring + 30U * BLACKBOX_ENTRIES_PER_S * sizeof(blackbox_entry_t),
                             blackbox_ring_size(30));
    TEST_ASSERT_EQUAL_size_t(sizeof *ring + BLACKBOX_ENTRIES_MIN * sizeof(blackbox_entry_t), blackbox_ring_size(0));
}

static void test_every_kind_has_a_name_of_its_own(void) {
    for (unsigned kind = 0; kind < BLACKBOX_KINDS; kind++) {
        TEST_ASSERT_EQUAL(kind, blackbox_kind_of(blackbox_kind_name((blackbox_kind_t)kind)));
    }
    TEST_ASSERT_EQUAL(BLACKBOX_KINDS, blackbox_kind_of("nonsense"));
    TEST_ASSERT_EQUAL_STRING("unknown", blackbox_kind_name(BLACKBOX_KINDS));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_empty_ring_has_nothing);
    RUN_TEST(test_entries_come_back_in_order);
    RUN_TEST(test_overwritten_entries_are_missing_and_nothing_else);
    RUN_TEST(test_full_ring_keeps_all_but_the_slot_to_come);
    RUN_TEST(test_size_follows_the_seconds_and_has_a_least);
    RUN_TEST(test_every_kind_has_a_name_of_its_own);
    return UNITY_END();
}
