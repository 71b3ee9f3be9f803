// SPDX-License-Identifier: MIT
// The records in flash, on a flash that loses power after any number of writes and erasures.
#include "unit.h"

#include "flash.h"
#include "store.h"

#include <string.h>

static uint32_t flash[BRD_FLASH_PAGES][BRD_FLASH_PAGE_WORDS];
static unsigned operations; ///< Operations since the start.
static unsigned cut_after;  ///< Number of complete operations; the next one is executed partly.
static unsigned erasures;
static unsigned reads;
static bool is_dead;     ///< No operation is executed any more.
static uint32_t torn_by; ///< Bits of the cut operation that were written.

uint32_t brd_flash_read(unsigned page, unsigned word) {
    reads++;
    return flash[page][word];
}

static bool is_cut(void) {
    is_dead = is_dead || operations > cut_after;
    return operations++ >= cut_after;
}

bool brd_flash_erase(unsigned page) {
    const bool cut = is_cut();
    if (is_dead) {
        return false;
    }
    erasures++;
    for (unsigned word = 0; word < BRD_FLASH_PAGE_WORDS; word++) {
        flash[page][word] |= (cut && word % 3U != 0U) ? torn_by : UINT32_MAX;
    }
    return !cut;
}

bool brd_flash_write(unsigned page, unsigned word, uint32_t value) {
    const bool cut = is_cut();
    if (is_dead) {
        return false;
    }
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(UINT32_MAX, flash[page][word], "a word was written twice");
    flash[page][word] = cut ? value | ~torn_by : value;
    return !cut;
}

void setUp(void) {
    memset(flash, 0xFF, sizeof flash);
    operations = erasures = 0;
    cut_after = UINT32_MAX;
    is_dead = false;
    torn_by = 0;
}

static void fill(uint32_t payload[BRD_STORE_WORDS], uint32_t number) {
    for (uint32_t word = 0; word < BRD_STORE_WORDS; word++) {
        payload[word] = number * 2654435761U + word * 40503U;
    }
}

static void power_up(void) {
    cut_after = UINT32_MAX;
    is_dead = false;
}

/// Returns the number of the stored record; 0: none.
static uint32_t newest(brd_store_t *store) {
    uint32_t found[BRD_STORE_WORDS];
    uint32_t wanted[BRD_STORE_WORDS];
    brd_store_open(store);
    if (!brd_store_read(store, found)) {
        return 0;
    }
    fill(wanted, found[0] * 244002641U); // The inverse of the factor returns the number of the record.
    TEST_ASSERT_EQUAL_HEX32_ARRAY_MESSAGE(wanted, found, BRD_STORE_WORDS, "a record of parts of two");
    return found[0] * 244002641U;
}

static bool write(brd_store_t *store, uint32_t number, bool may_erase) {
    uint32_t payload[BRD_STORE_WORDS];
    fill(payload, number);
    return brd_store_write(store, payload, may_erase);
}

TEST(test_store_blank_flash_has_no_record) {
    brd_store_t store;
    TEST_ASSERT_EQUAL_UINT32(0, newest(&store));
    TEST_ASSERT_EQUAL_UINT(4, brd_store_blank(&store));
}

TEST(test_store_newest_record_is_the_last_one_written) {
    brd_store_t store;
    (void)newest(&store);
    for (uint32_t number = 1; number <= 50U; number++) {
        TEST_ASSERT_TRUE(write(&store, number, true));
        TEST_ASSERT_EQUAL_UINT32(number, newest(&store));
        TEST_ASSERT_GREATER_OR_EQUAL_UINT(2, brd_store_blank(&store));
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(25, erasures);
}

TEST(test_store_without_erasing_full_page_refuses_a_record) {
    brd_store_t store;
    (void)newest(&store);
    for (uint32_t number = 1; number <= 4U; number++) {
        TEST_ASSERT_TRUE(write(&store, number, false));
    }
    TEST_ASSERT_FALSE(write(&store, 5, false));
    TEST_ASSERT_TRUE(store.failed);
    TEST_ASSERT_EQUAL_UINT(0, erasures);
    TEST_ASSERT_EQUAL_UINT32(4, newest(&store));
}

/// Writes one record after another, with a cut after every operation of each, and any bits of the last operation
/// written.
TEST(test_store_cut_at_any_instant_leaves_the_old_or_new_record) {
    static const uint32_t torn[] = {0, 0x0000FFFF, 0xFFFF0000, 0x55555555, UINT32_MAX};
    for (unsigned way = 0; way < sizeof torn / sizeof torn[0]; way++) {
        brd_store_t store;
        uint32_t number = 0;
        setUp();
        torn_by = torn[way];
        (void)newest(&store);
        for (unsigned cut = 0; cut < 3U * 66U; cut++) {
            const uint32_t before = newest(&store);
            operations = 0;
            cut_after = cut % 66U;
            number++;
            const bool done = write(&store, number, true);
            power_up();
            const uint32_t after = newest(&store);
            TEST_ASSERT_TRUE_MESSAGE(after == before || after == number, "neither the old nor the new one");
            TEST_ASSERT_TRUE_MESSAGE(!done || after == number, "it was reported as written and is not");
        }
        TEST_ASSERT_TRUE_MESSAGE(write(&store, number + 1U, true), "cuts left no way to go on");
    }
}

/// After a restart in motion the wheels wait for the first zeros while the record is searched.
TEST(test_store_open_computes_one_crc_per_page) {
    brd_store_t store;
    (void)newest(&store);
    for (uint32_t number = 1; brd_store_blank(&store) > 0U || erasures == 0U; number++) {
        TEST_ASSERT_TRUE(write(&store, number, erasures == 0U));
    }
    reads = 0;
    brd_store_open(&store);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(BRD_FLASH_PAGES * (64U + 2U + 2U * BRD_FLASH_PAGE_WORDS / 64U), reads);
}

TEST(test_store_flipped_bit_falls_back_to_the_previous_record) {
    brd_store_t store;
    (void)newest(&store);
    TEST_ASSERT_TRUE(write(&store, 1, true));
    TEST_ASSERT_TRUE(write(&store, 2, true));
    for (unsigned bit = 0; bit < 64U * 32U; bit++) {
        uint32_t *const word = &flash[store.page][store.slot * 64U + bit / 32U];
        *word ^= 1U << bit % 32U;
        brd_store_t again;
        TEST_ASSERT_EQUAL_UINT32(1, newest(&again));
        *word ^= 1U << bit % 32U;
    }
}
