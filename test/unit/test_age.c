// SPDX-License-Identifier: MIT
// How long ago something was, in 32 bits: the longest there is stands for longer than that, never, and not yet.
#include "arithmetic.h"

#include "unit.h"

#define NOW ((iw_time_us_t)1000000000000U)

TEST(test_age_is_told_to_the_microsecond_up_to_the_longest) {
    TEST_ASSERT_EQUAL_UINT32(0, iw_age_us(NOW, NOW));
    TEST_ASSERT_EQUAL_UINT32(1, iw_age_us(NOW - 1U, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX - 1U, iw_age_us(NOW - (UINT32_MAX - 1U), NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW - UINT32_MAX, NOW));
}

TEST(test_age_beyond_the_longest_never_wraps_into_a_short_one) {
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW - UINT32_MAX - 1U, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW - 2U * (iw_time_us_t)UINT32_MAX, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(0, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(0, IW_NEVER));
}

TEST(test_age_of_what_was_never_or_is_still_to_come_is_the_longest) {
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(IW_NEVER, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW + 1U, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW + UINT32_MAX, NOW));
}
