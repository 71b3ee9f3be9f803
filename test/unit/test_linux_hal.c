// SPDX-License-Identifier: MIT
#include "bus.h"

#include "iwheel_linux/linux_hal.h"

#include <unity.h>

static iw_linux_hal_t hal;
static bool was_quiet;
static int answer;

static int fake_pressed(void *self, bool quiet) {
    (void)self;
    was_quiet = quiet;
    return answer;
}

static iw_time_us_t estop_due_us;

static iw_time_us_t fake_next_us(const void *self) {
    (void)self;
    return estop_due_us;
}

static const iw_estop_ops_t fake_ops = {.pressed = fake_pressed, .next_us = fake_next_us, .present = true};

void setUp(void) {
    hal = (iw_linux_hal_t){.estop_ops = &fake_ops, .estop_last = -1};
    answer = 0;
}

void tearDown(void) {}

static int look(void) {
    return iw_linux_hal_pressed(&hal);
}

static void test_estop_is_read_whole_by_whoever_does_not_wait(void) {
    (void)look();
    TEST_ASSERT_FALSE(was_quiet);
}

static void test_estop_that_was_not_told_of_has_no_edges(void) {
    iw_linux_hal_waited(&hal, (iw_linux_told_t){false, false});
    (void)look();
    TEST_ASSERT_TRUE(was_quiet);
}

static void test_estop_that_was_told_of_is_read_whole(void) {
    iw_linux_hal_waited(&hal, (iw_linux_told_t){false, false});
    iw_linux_hal_waited(&hal, (iw_linux_told_t){false, true});
    (void)look();
    TEST_ASSERT_FALSE(was_quiet);
}

static void test_wait_counts_for_one_look(void) {
    iw_linux_hal_waited(&hal, (iw_linux_told_t){false, false});
    (void)look();
    (void)look();
    TEST_ASSERT_FALSE(was_quiet);
}

static void test_last_answer_is_kept(void) {
    answer = 1;
    TEST_ASSERT_EQUAL_INT(1, look());
    TEST_ASSERT_EQUAL_INT(1, hal.estop_last);
}

static void test_next_time_is_the_sooner_of_bus_and_estop(void) {
    iw_bus_t *bus = (iw_bus_t *)(void *)&hal.bus;
    bus->look_us = 200;
    estop_due_us = 100;
    TEST_ASSERT_EQUAL_UINT64(100, iw_linux_hal_next_us(&hal));
    estop_due_us = 300;
    TEST_ASSERT_EQUAL_UINT64(200, iw_linux_hal_next_us(&hal));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_estop_is_read_whole_by_whoever_does_not_wait);
    RUN_TEST(test_estop_that_was_not_told_of_has_no_edges);
    RUN_TEST(test_estop_that_was_told_of_is_read_whole);
    RUN_TEST(test_wait_counts_for_one_look);
    RUN_TEST(test_last_answer_is_kept);
    RUN_TEST(test_next_time_is_the_sooner_of_bus_and_estop);
    return UNITY_END();
}
