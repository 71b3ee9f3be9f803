// SPDX-License-Identifier: MIT
// The load of the bus, computed once per second.
#include "bus.h"

#include "unit.h"

#define START_US 5000000U
#define SECOND   1000000U

static iwl_bus_load_t load;
static uint32_t permille;

void setUp(void) {
    iwl_bus_load_begin(&load, START_US);
    permille = 77U;
}

TEST(test_load_is_reported_at_the_end_of_each_second) {
    load.bits = 250000U;
    TEST_ASSERT_FALSE(iwl_bus_load_take(&load, START_US + SECOND - 1U, 1000000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(77U, permille);
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + SECOND, 1000000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(250U, permille);
}

TEST(test_load_of_each_second_starts_at_zero) {
    load.bits = 250000U;
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + SECOND, 1000000U, &permille));
    TEST_ASSERT_FALSE(iwl_bus_load_take(&load, START_US + SECOND + 1U, 1000000U, &permille));
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + 2U * SECOND, 1000000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(0U, permille);
}

TEST(test_load_of_a_late_call_covers_the_whole_time) {
    load.bits = 1000000U;
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + 4U * SECOND, 1000000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(250U, permille);
}

TEST(test_load_without_a_bit_rate_uses_that_of_the_wheels) {
    load.bits = 250000U;
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + SECOND, 500000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(500U, permille);
    load.bits = 250000U;
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + 2U * SECOND, 0U, &permille));
    TEST_ASSERT_EQUAL_UINT32(250U, permille);
}
