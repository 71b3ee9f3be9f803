// SPDX-License-Identifier: MIT
// Two contacts of one button: pressed by either, released by both, and what ends a disagreement.
#include "iwheel/hal.h"

#include "unity.h"

#define MS(value) ((iw_time_us_t)(value)*1000U)
#define LIMIT_MS  200U

static iw_estop_pair_t pair;
static iw_time_us_t now_us;

void setUp(void) {
    now_us = MS(5000);
    pair = (iw_estop_pair_t){.disagrees = true, .proven = true}; // Nothing of before is left.
    iw_estop_pair_init(&pair, (uint32_t)MS(LIMIT_MS));
}

void tearDown(void) {}

static int see(int first, int second) {
    return iw_estop_pair_see(&pair, now_us, first, second);
}

/// The last answer of these two, looked at every millisecond.
static int hold(int first, int second, unsigned for_ms) {
    int answer = see(first, second);
    for (unsigned ms = 0; ms < for_ms; ms++) {
        now_us += MS(1);
        answer = see(first, second);
    }
    return answer;
}

static void test_pair_is_pressed_at_once_by_either_and_released_only_by_both(void) {
    TEST_ASSERT_EQUAL_INT(0, see(0, 0));
    TEST_ASSERT_EQUAL_INT(1, see(1, 0));
    TEST_ASSERT_EQUAL_INT(1, see(1, 1));
    TEST_ASSERT_EQUAL_INT(1, see(0, 1));
    TEST_ASSERT_EQUAL_INT(0, see(0, 0));
    TEST_ASSERT_EQUAL_INT(1, see(0, 7));
}

static void test_pair_may_differ_for_the_limit_and_no_longer(void) {
    for (int side = 0; side < 2; side++) {
        setUp();
        TEST_ASSERT_EQUAL_INT(1, hold(side, 1 - side, LIMIT_MS));
        now_us += 1U;
        TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, see(side, 1 - side));
    }
}

static void test_pair_that_agrees_in_between_begins_anew(void) {
    (void)hold(1, 0, LIMIT_MS);
    TEST_ASSERT_EQUAL_INT(1, hold(1, 1, 10));
    TEST_ASSERT_EQUAL_INT(1, hold(0, 1, LIMIT_MS));
    TEST_ASSERT_EQUAL_INT(0, hold(0, 0, 1000));
    TEST_ASSERT_EQUAL_INT(1, hold(0, 1, LIMIT_MS));
}

static void test_pair_that_disagreed_agrees_after_both_were_pressed_then_released(void) {
    (void)hold(1, 0, 300);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 5000)); // A contact that is shorted reads the same.
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(1, 0, 300));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 1, 10)); // Each of them pressed, but never both.
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(1, 1, 1000));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(1, 0, 10));
    TEST_ASSERT_EQUAL_INT(0, hold(0, 0, 1000));
    TEST_ASSERT_EQUAL_INT(1, see(1, 0));
    TEST_ASSERT_EQUAL_INT(0, see(0, 0)); // The old proof and the old disagreement are over.
    (void)hold(1, 0, 300);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10));
}

static void test_pair_whose_release_is_late_disagrees_again(void) {
    (void)hold(1, 0, 300);
    (void)hold(1, 1, 300);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(1, 0, 1000));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 1000));
    (void)hold(1, 1, 300);
    TEST_ASSERT_EQUAL_INT(0, hold(0, 0, 1));
}

static void test_pair_pressed_before_it_disagreed_proves_nothing(void) {
    TEST_ASSERT_EQUAL_INT(1, hold(1, 1, 1000));
    (void)hold(1, 0, 300);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 1000));
}

static void test_pair_that_cannot_be_read_is_unreadable_and_nothing_else(void) {
    TEST_ASSERT_EQUAL_INT(-1, hold(-1, 0, 1000));
    TEST_ASSERT_EQUAL_INT(-1, hold(1, -1, 1000));
    TEST_ASSERT_EQUAL_INT(-1, hold(-2, -1, 10));
    TEST_ASSERT_EQUAL_INT(0, hold(0, 0, 10));
    (void)hold(1, 0, 150);
    TEST_ASSERT_EQUAL_INT(-1, hold(1, -1, 10));
    TEST_ASSERT_EQUAL_INT(1, hold(1, 0, 150)); // It begins anew.
    (void)hold(1, 0, 300);
    TEST_ASSERT_EQUAL_INT(-1, hold(-1, -1, 10));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10)); // And ends none.
    (void)hold(1, 1, 10);
    (void)hold(1, -1, 10);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10)); // Nor is it part of a proof.
}

static void test_pair_looked_at_rarely_still_disagrees(void) {
    TEST_ASSERT_EQUAL_INT(1, see(0, 1));
    now_us += MS(5000);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, see(0, 1));
}

static void test_pair_tells_when_it_will_disagree(void) {
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iw_estop_pair_next_us(&pair));
    (void)see(1, 0);
    const iw_time_us_t due_us = iw_estop_pair_next_us(&pair);
    TEST_ASSERT_EQUAL_UINT64(now_us + MS(LIMIT_MS) + 1U, due_us);
    now_us = due_us;
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, see(1, 0));
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iw_estop_pair_next_us(&pair));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_pair_is_pressed_at_once_by_either_and_released_only_by_both);
    RUN_TEST(test_pair_may_differ_for_the_limit_and_no_longer);
    RUN_TEST(test_pair_that_agrees_in_between_begins_anew);
    RUN_TEST(test_pair_that_disagreed_agrees_after_both_were_pressed_then_released);
    RUN_TEST(test_pair_whose_release_is_late_disagrees_again);
    RUN_TEST(test_pair_pressed_before_it_disagreed_proves_nothing);
    RUN_TEST(test_pair_that_cannot_be_read_is_unreadable_and_nothing_else);
    RUN_TEST(test_pair_looked_at_rarely_still_disagrees);
    RUN_TEST(test_pair_tells_when_it_will_disagree);
    return UNITY_END();
}
