// SPDX-License-Identifier: MIT
// Wheels that turn without setpoints: when this begins, when it ends, and when it is a fault.
#include "fixture.h"
#include "iwheel/private/rolling.h"
#include "unit.h"

static iw_rolling_t rolling;
static iw_time_us_t now_us;

void setUp(void) {
    rolling = (iw_rolling_t){.rolling = true, .is_fault = true, .since_us = 1, .setpoint_us = 1};
    iw_rolling_init(&rolling);
    now_us = FIXTURE_START_US;
}

static void run(bool turns, uint32_t for_ms) {
    for (uint32_t ms = 0; ms < for_ms; ms++) {
        now_us += 1000U;
        iw_rolling_step(&rolling, now_us, turns);
    }
}

TEST(test_rolling_begins_after_300_ms_and_ends_after_300_ms) {
    run(false, 1000);
    run(true, 300);
    TEST_ASSERT_FALSE(rolling.rolling);
    run(true, 1);
    TEST_ASSERT_TRUE(rolling.rolling);
    run(true, 5000);
    run(false, 300);
    TEST_ASSERT_TRUE(rolling.rolling);
    run(false, 1);
    TEST_ASSERT_FALSE(rolling.rolling);
    TEST_ASSERT_FALSE(rolling.is_fault);
}

TEST(test_rolling_pulses_shorter_than_300_ms_do_not_add_up) {
    for (uint32_t i = 0; i < 20U; i++) {
        run(true, 290);
        run(false, 1);
        TEST_ASSERT_FALSE(rolling.rolling);
    }
    run(true, 301);
    for (uint32_t i = 0; i < 20U; i++) {
        run(false, 290);
        run(true, 1);
        TEST_ASSERT_TRUE(rolling.rolling);
    }
}

/// It is no fault either when the clock has just started, as that of a board does.
TEST(test_rolling_without_setpoints_before_is_no_fault) {
    static const iw_time_us_t begin_us[] = {0, FIXTURE_START_US};
    for (size_t i = 0; i < 2U; i++) {
        setUp();
        TEST_ASSERT_FALSE(rolling.is_fault);
        now_us = begin_us[i];
        run(true, 400);
        TEST_ASSERT_TRUE(rolling.rolling);
        TEST_ASSERT_FALSE(rolling.is_fault);
    }
}

TEST(test_rolling_within_10_s_after_a_setpoint_is_a_fault) {
    static const struct {
        uint32_t after_ms;
        bool fault;
    } cases[] = {{0, true}, {1, true}, {9998, true}, {9999, false}, {20000, false}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        rolling.setpoint_us = now_us;
        run(false, cases[i].after_ms);
        run(true, 301);
        TEST_ASSERT_TRUE(rolling.rolling);
        TEST_ASSERT_EQUAL_INT(cases[i].fault, rolling.is_fault);
        run(false, 301);
        TEST_ASSERT_FALSE(rolling.is_fault);
    }
}
