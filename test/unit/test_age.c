// SPDX-License-Identifier: MIT
// Age of an event as 32 bits in microseconds. UINT32_MAX means a longer age, for an event that never happened and
// for a future one.
#include "arithmetic.h"

#include "unit.h"

#define NOW ((iw_time_us_t)1000000000000U)

TEST(test_age_up_to_uint32_max_is_exact_to_the_microsecond) {
    TEST_ASSERT_EQUAL_UINT32(0, iw_age_us(NOW, NOW));
    TEST_ASSERT_EQUAL_UINT32(1, iw_age_us(NOW - 1U, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX - 1U, iw_age_us(NOW - (UINT32_MAX - 1U), NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW - UINT32_MAX, NOW));
}

TEST(test_age_beyond_uint32_max_saturates) {
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW - UINT32_MAX - 1U, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW - 2U * (iw_time_us_t)UINT32_MAX, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(0, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(0, IW_NEVER));
}

TEST(test_age_of_never_or_future_time_is_uint32_max) {
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(IW_NEVER, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW + 1U, NOW));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_age_us(NOW + UINT32_MAX, NOW));
}
