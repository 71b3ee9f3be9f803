// SPDX-License-Identifier: MIT
#include "blackbox_ring.h"

#include "unit.h"
#include <stdlib.h>
#include <string.h>

/// More entries than a ring of one second holds.
#define MANY 20000U

static blackbox_ring_t *ring;
static blackbox_entry_t out[MANY];

void setUp(void) {
    const size_t size = blackbox_ring_size(1);
    ring = (blackbox_ring_t *)malloc(size);
    TEST_ASSERT_NOT_NULL(ring);
    memset(ring, 0xA5, size);
    blackbox_ring_init(ring, 1);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(MANY, blackbox_ring_most(ring));
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

/// Checks that the entries from `first` on are returned, and no others.
static void expect(uint64_t from, uint64_t to, uint64_t first, size_t count) {
    size_t got;
    TEST_ASSERT_EQUAL_UINT64(first, blackbox_ring_copy(ring, from, to, out, &got));
    TEST_ASSERT_EQUAL_size_t(count, got);
    for (size_t i = 0; i < got; i++) {
        TEST_ASSERT_EQUAL_UINT64(first + i, out[i].at_us);
        TEST_ASSERT_EQUAL_UINT32((uint32_t)(first + i), out[i].number);
    }
}

TEST(test_ring_empty_returns_no_entries) {
    expect(0, UINT64_MAX, 0, 0);
    TEST_ASSERT_EQUAL_UINT64(0, blackbox_ring_written(ring));
}

TEST(test_ring_entries_are_returned_in_order) {
    put(0, 10);
    expect(0, 10, 0, 10);
    expect(3, 7, 3, 4);
    expect(0, UINT64_MAX, 0, 10);
    expect(10, UINT64_MAX, 10, 0);
}

TEST(test_ring_after_overwrite_only_oldest_entries_are_missing) {
    size_t count;
    put(0, MANY);
    const uint64_t first = blackbox_ring_copy(ring, 0, UINT64_MAX, out, &count);
    TEST_ASSERT_FALSE(blackbox_ring_is_whole(ring));
    TEST_ASSERT_GREATER_THAN_UINT64(0, first);
    expect(0, UINT64_MAX, first, (size_t)(MANY - first));
    expect(first + 700U, first + 900U, first + 700U, 200);
    expect(0, first + 9U, first, 9);
    expect(0, first / 2U, first, 0);
    expect(MANY - 3U, MANY, MANY - 3U, 3);
    expect(MANY, MANY, MANY, 0);
}

TEST(test_ring_is_whole_until_the_first_block_is_overwritten) {
    size_t count;
    uint64_t n = 0;
    for (; blackbox_ring_is_whole(ring); n++) {
        expect(0, 1, 0, (n == 0U) ? 0U : 1U);
        put(n, n + 1U);
    }
    TEST_ASSERT_GREATER_THAN_UINT64(0, blackbox_ring_copy(ring, 0, UINT64_MAX, out, &count));
    TEST_ASSERT_LESS_OR_EQUAL_size_t(blackbox_ring_most(ring), n);
}

/// Entries of two wheels and a client at 50 Hz during a second without faults, one step at a time.
TEST(test_ring_of_one_second_holds_1500_ms_of_driving) {
    const blackbox_entry_t speed = {.kind = BLACKBOX_FRAME, .number = 256, .a = 4};
    const blackbox_entry_t echo = {.kind = BLACKBOX_FRAME, .number = 266, .a = 5, .b = IW_CAN_ECHO};
    const blackbox_entry_t drive = {.kind = BLACKBOX_DRIVE, .number = 1, .as = {.drive = {{300, 300}, {0, 0}, 1}}};
    const blackbox_entry_t step = {.kind = BLACKBOX_STEP};
    for (uint64_t us = 0; us < 1500000U; us += 20000U) {
        for (unsigned i = 0; i < 21U; i++) {
            blackbox_entry_t entry = (i < 13U) ? speed : (i < 15U) ? echo : (i < 16U) ? drive : step;
            entry.at_us = us + 900U * i;
            blackbox_ring_put(ring, &entry);
        }
    }
    TEST_ASSERT_TRUE(blackbox_ring_is_whole(ring));
}

static void expect_back(const blackbox_entry_t *entries, size_t count) {
    size_t got;
    for (size_t i = 0; i < count; i++) {
        blackbox_ring_put(ring, &entries[i]);
    }
    TEST_ASSERT_EQUAL_UINT64(0, blackbox_ring_copy(ring, 0, UINT64_MAX, out, &got));
    TEST_ASSERT_EQUAL_size_t(count, got);
    for (size_t i = 0; i < count; i++) {
        TEST_ASSERT_EQUAL_UINT64(entries[i].at_us, out[i].at_us);
        TEST_ASSERT_EQUAL_MEMORY(&entries[i].as, &out[i].as, sizeof out[i].as);
        TEST_ASSERT_EQUAL_UINT32(entries[i].number, out[i].number);
        TEST_ASSERT_EQUAL_UINT8(entries[i].kind, out[i].kind);
        TEST_ASSERT_EQUAL_UINT8(entries[i].a, out[i].a);
        TEST_ASSERT_EQUAL_UINT8(entries[i].b, out[i].b);
    }
}

TEST(test_ring_every_kind_of_entry_is_returned_unchanged) {
    blackbox_entry_t entries[3U * BLACKBOX_KINDS];
    for (unsigned kind = 0; kind < BLACKBOX_KINDS; kind++) {
        blackbox_entry_t *three = &entries[3U * kind];
        three[0] = (blackbox_entry_t){.at_us = 1000U * kind, .kind = (uint8_t)kind};
        three[1] =
            (blackbox_entry_t){.at_us = 1000U * kind, .kind = (uint8_t)kind, .number = UINT16_MAX, .a = 8, .b = 1};
        three[2] = (blackbox_entry_t){
            .at_us = 1000U * kind + 1U, .kind = (uint8_t)kind, .number = UINT32_MAX, .a = 255, .b = 255};
        memset(&three[1].as, 0x80, (kind == BLACKBOX_FRAME) ? 8U : sizeof three[1].as);
        three[2].as.value = INT64_MIN;
    }
    expect_back(entries, sizeof entries / sizeof entries[0]);
}

TEST(test_ring_frame_stores_dlc_bytes_only) {
    const blackbox_entry_t entry = {.kind = BLACKBOX_FRAME, .a = 3, .as = {.data = {1, 2, 3, 4, 5, 6, 7, 8}}};
    const uint8_t stored[IW_CAN_DATA_MAX] = {1, 2, 3};
    size_t count;
    blackbox_ring_put(ring, &entry);
    (void)blackbox_ring_copy(ring, 0, 1, out, &count);
    TEST_ASSERT_EQUAL_MEMORY(stored, out[0].as.data, sizeof stored);
}

TEST(test_ring_distant_and_decreasing_times_are_returned) {
    const blackbox_entry_t entries[] = {
        {.at_us = 5, .kind = BLACKBOX_STEP},
        {.at_us = 5U + 0xFFFFFFU, .kind = BLACKBOX_STEP},
        {.at_us = 5U + 0xFFFFFFU + 1U, .kind = BLACKBOX_STEP},
        {.at_us = UINT64_MAX, .kind = BLACKBOX_STEP},
        {.at_us = 7, .kind = BLACKBOX_STEP},
        {.at_us = 7, .kind = BLACKBOX_BUS, .a = 3},
    };
    expect_back(entries, sizeof entries / sizeof entries[0]);
}

TEST(test_ring_size_is_proportional_with_a_minimum) {
    TEST_ASSERT_EQUAL_size_t(sizeof *ring + (size_t)30U * BLACKBOX_BLOCKS_PER_S * BLACKBOX_BLOCK,
                             blackbox_ring_size(30));
    TEST_ASSERT_EQUAL_size_t(sizeof *ring + (size_t)BLACKBOX_BLOCKS_MIN * BLACKBOX_BLOCK, blackbox_ring_size(0));
    TEST_ASSERT_LESS_THAN_size_t(640000U, blackbox_ring_size(30)); // Limit that the page of recordings states.
}

TEST(test_ring_kind_names_are_unique) {
    for (unsigned kind = 0; kind < BLACKBOX_KINDS; kind++) {
        TEST_ASSERT_EQUAL(kind, blackbox_kind_of(blackbox_kind_name((blackbox_kind_t)kind)));
    }
    TEST_ASSERT_EQUAL(BLACKBOX_KINDS, blackbox_kind_of("nonsense"));
    TEST_ASSERT_EQUAL_STRING("unknown", blackbox_kind_name(BLACKBOX_KINDS));
}
