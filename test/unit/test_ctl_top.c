// SPDX-License-Identifier: MIT
// The history that `iwheelctl top` draws, also on a machine that has just booted: its clock begins at zero.
#include "top/top.h"

#include "unit.h"

#include <string.h>

#define GUARD      0xA5
#define GUARD_SIZE 4096U

static struct {
    unsigned char before[GUARD_SIZE];
    top_history_t history;
} memory;

void setUp(void) {
    memset(memory.before, GUARD, sizeof memory.before);
    memset(&memory.history, 0, sizeof memory.history);
}

static void take(int64_t now_us, int speed_mm_s) {
    json_t *state = json_pack("{s:{s:i}}", "left", "speed_mm_s", speed_mm_s);
    top_history_take(&memory.history, now_us, state);
    json_decref(state);
}

static void nothing_is_written_before_it(void) {
    for (size_t i = 0; i < GUARD_SIZE; i++) {
        TEST_ASSERT_EQUAL_HEX8(GUARD, memory.before[i]);
    }
}

static int32_t newest(void) {
    return memory.history.value[0][memory.history.slot % TOP_HISTORY];
}

static int known(void) {
    int count = 0;
    for (int i = 0; i < TOP_HISTORY; i++) {
        count += (memory.history.value[0][i] != INT32_MIN) ? 1 : 0;
    }
    return count;
}

TEST(test_history_after_boot_stays_inside_its_memory) {
    for (int64_t now_us = 0; now_us < INT64_C(130) * 1000000; now_us += TOP_HISTORY_US) {
        memset(&memory.history, 0, sizeof memory.history); // The program starts at this time.
        take(now_us, 300);
        nothing_is_written_before_it();
        TEST_ASSERT_EQUAL_INT32(300, newest());
        TEST_ASSERT_EQUAL_INT(1, known());
    }
}

TEST(test_history_without_values_has_a_gap) {
    take(INT64_C(59950000), 100);
    top_history_take(&memory.history, INT64_C(60050000), NULL);
    take(INT64_C(60350000), 200);
    nothing_is_written_before_it();
    TEST_ASSERT_EQUAL_INT32(200, newest());
    TEST_ASSERT_EQUAL_INT(2, known());
    take(INT64_C(180000000), 300);
    TEST_ASSERT_EQUAL_INT32(300, newest());
    TEST_ASSERT_EQUAL_INT(1, known());
}
