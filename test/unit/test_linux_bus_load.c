// SPDX-License-Identifier: MIT
// The load of the bus, told once a second.
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

TEST(test_load_is_told_when_the_second_is_over_and_not_before) {
    load.bits = 250000U;
    TEST_ASSERT_FALSE(iwl_bus_load_take(&load, START_US + SECOND - 1U, 1000000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(77U, permille);
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + SECOND, 1000000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(250U, permille);
}

TEST(test_load_every_second_begins_anew) {
    load.bits = 250000U;
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + SECOND, 1000000U, &permille));
    TEST_ASSERT_FALSE(iwl_bus_load_take(&load, START_US + SECOND + 1U, 1000000U, &permille));
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + 2U * SECOND, 1000000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(0U, permille);
}

TEST(test_load_of_a_look_that_comes_late_is_of_all_the_time) {
    load.bits = 1000000U;
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + 4U * SECOND, 1000000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(250U, permille);
}

TEST(test_load_is_of_the_bit_rate_and_of_the_wheels_if_none_is_known) {
    load.bits = 250000U;
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + SECOND, 500000U, &permille));
    TEST_ASSERT_EQUAL_UINT32(500U, permille);
    load.bits = 250000U;
    TEST_ASSERT_TRUE(iwl_bus_load_take(&load, START_US + 2U * SECOND, 0U, &permille));
    TEST_ASSERT_EQUAL_UINT32(250U, permille);
}
