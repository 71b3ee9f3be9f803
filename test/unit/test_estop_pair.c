// SPDX-License-Identifier: MIT
// Two contacts of one button: pressed by either, released by both, and the end of a disagreement.
#include "iwheel/hal.h"

#include "unit.h"

#define MS(value) ((iw_time_us_t)(value)*1000U)
#define LIMIT_MS  200U

static iw_estop_pair_t pair;
static iw_time_us_t now_us;

void setUp(void) {
    now_us = MS(5000);
    pair = (iw_estop_pair_t){.disagrees = true, .proven = true}; // The init must reset these.
    iw_estop_pair_init(&pair, (uint32_t)MS(LIMIT_MS));
}

static int see(int first, int second) {
    return iw_estop_pair_see(&pair, now_us, first, second);
}

/// Holds these answers, polled every millisecond. Returns the last result.
static int hold(int first, int second, unsigned for_ms) {
    int answer = see(first, second);
    for (unsigned ms = 0; ms < for_ms; ms++) {
        now_us += MS(1);
        answer = see(first, second);
    }
    return answer;
}

TEST(test_estop_pair_is_pressed_by_either_and_released_by_both) {
    TEST_ASSERT_EQUAL_INT(0, see(0, 0));
    TEST_ASSERT_EQUAL_INT(1, see(1, 0));
    TEST_ASSERT_EQUAL_INT(1, see(1, 1));
    TEST_ASSERT_EQUAL_INT(1, see(0, 1));
    TEST_ASSERT_EQUAL_INT(0, see(0, 0));
    TEST_ASSERT_EQUAL_INT(1, see(0, 7));
}

TEST(test_estop_pair_may_differ_up_to_the_limit) {
    for (int side = 0; side < 2; side++) {
        setUp();
        TEST_ASSERT_EQUAL_INT(1, hold(side, 1 - side, LIMIT_MS));
        now_us += 1U;
        TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, see(side, 1 - side));
    }
}

TEST(test_estop_pair_agreement_restarts_the_time) {
    (void)hold(1, 0, LIMIT_MS);
    TEST_ASSERT_EQUAL_INT(1, hold(1, 1, 10));
    TEST_ASSERT_EQUAL_INT(1, hold(0, 1, LIMIT_MS));
    TEST_ASSERT_EQUAL_INT(0, hold(0, 0, 1000));
    TEST_ASSERT_EQUAL_INT(1, hold(0, 1, LIMIT_MS));
}

TEST(test_estop_pair_disagrees_until_both_pressed_and_released) {
    (void)hold(1, 0, 300);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 5000)); // A shorted contact reads the same.
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(1, 0, 300));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 1, 10)); // Each contact was pressed, but never both.
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(1, 1, 1000));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(1, 0, 10));
    TEST_ASSERT_EQUAL_INT(0, hold(0, 0, 1000));
    TEST_ASSERT_EQUAL_INT(1, see(1, 0));
    TEST_ASSERT_EQUAL_INT(0, see(0, 0)); // The old proof and the old disagreement have ended.
    (void)hold(1, 0, 300);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10));
}

TEST(test_estop_pair_late_release_disagrees_again) {
    (void)hold(1, 0, 300);
    (void)hold(1, 1, 300);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(1, 0, 1000));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 1000));
    (void)hold(1, 1, 300);
    TEST_ASSERT_EQUAL_INT(0, hold(0, 0, 1));
}

TEST(test_estop_pair_press_before_disagreement_proves_nothing) {
    TEST_ASSERT_EQUAL_INT(1, hold(1, 1, 1000));
    (void)hold(1, 0, 300);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 1000));
}

TEST(test_estop_pair_unreadable_contact_is_unreadable) {
    TEST_ASSERT_EQUAL_INT(-1, hold(-1, 0, 1000));
    TEST_ASSERT_EQUAL_INT(-1, hold(1, -1, 1000));
    TEST_ASSERT_EQUAL_INT(-1, hold(-2, -1, 10));
    TEST_ASSERT_EQUAL_INT(0, hold(0, 0, 10));
    (void)hold(1, 0, 150);
    TEST_ASSERT_EQUAL_INT(-1, hold(1, -1, 10));
    TEST_ASSERT_EQUAL_INT(1, hold(1, 0, 150)); // The time restarts.
    (void)hold(1, 0, 300);
    TEST_ASSERT_EQUAL_INT(-1, hold(-1, -1, 10));
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10)); // A disagreement continues.
    (void)hold(1, 1, 10);
    (void)hold(1, -1, 10);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hold(0, 0, 10)); // An unreadable contact is no part of a proof.
}

TEST(test_estop_pair_polled_rarely_disagrees) {
    TEST_ASSERT_EQUAL_INT(1, see(0, 1));
    now_us += MS(5000);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, see(0, 1));
}

TEST(test_estop_pair_next_us_is_the_time_of_disagreement) {
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iw_estop_pair_next_us(&pair));
    (void)see(1, 0);
    const iw_time_us_t due_us = iw_estop_pair_next_us(&pair);
    TEST_ASSERT_EQUAL_UINT64(now_us + MS(LIMIT_MS) + 1U, due_us);
    now_us = due_us;
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, see(1, 0));
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iw_estop_pair_next_us(&pair));
}
