// SPDX-License-Identifier: MIT
#include "bus.h"

#include "iwheel_linux/linux_hal.h"

#include "unit.h"
#include <errno.h>
#include <stdio.h>

static iwl_hal_t hal;
static bool was_quiet;
static int answer;
static int answer2;
static unsigned reads;

static int fake_pressed(void *self, bool quiet) {
    const bool second = self == &hal.estop2;
    reads += second ? 10U : 1U;
    was_quiet = quiet;
    return second ? answer2 : answer;
}

static iw_time_us_t estop_due_us;
static iw_time_us_t estop2_due_us;

static iw_time_us_t fake_next_us(const void *self) {
    return (self == &hal.estop2) ? estop2_due_us : estop_due_us;
}

static int fake_trouble(const void *self) {
    return (self == &hal.estop2) ? 2 : 1;
}

static int fake_fd(const void *self) {
    return (self == &hal.estop2) ? 20 : 10;
}

static void bus_tend(iwl_bus_t *self) {
    (void)self;
}

static const iwl_bus_kind_t bus_kind = {.close = bus_tend, .poll = bus_tend};
static unsigned polled;
static unsigned closed;

static void fake_tend(void *self, iw_time_us_t now_us) {
    (void)now_us;
    polled += (self == &hal.estop2) ? 10U : 1U;
}

static void fake_close(void *self) {
    closed += (self == &hal.estop2) ? 10U : 1U;
}

static const iwl_estop_ops_t fake_ops = {.close = fake_close,
                                         .watch_fd = fake_fd,
                                         .poll = fake_tend,
                                         .pressed = fake_pressed,
                                         .next_us = fake_next_us,
                                         .trouble = fake_trouble,
                                         .present = true};

void setUp(void) {
    hal = (iwl_hal_t){.estop_ops = &fake_ops, .estop_last = -1};
    ((iwl_bus_t *)(void *)&hal.bus)->kind = &bus_kind;
    answer = 0;
}

static int read_estop(void) {
    return iwl_hal_pressed(&hal);
}

TEST(test_hal_estop_without_a_wait_is_read_fully) {
    (void)read_estop();
    TEST_ASSERT_FALSE(was_quiet);
}

TEST(test_hal_estop_not_reported_by_the_wait_has_no_edges) {
    iwl_hal_waited(&hal, (iwl_reported_t){false, false});
    (void)read_estop();
    TEST_ASSERT_TRUE(was_quiet);
}

TEST(test_hal_reports_to_the_bus_whether_the_wait_found_it) {
    const iwl_bus_t *bus = (const iwl_bus_t *)(const void *)&hal.bus;
    iwl_hal_waited(&hal, (iwl_reported_t){.bus = false, .estop = true});
    TEST_ASSERT_TRUE(bus->quiet);
    iwl_hal_waited(&hal, (iwl_reported_t){.bus = true, .estop = false});
    TEST_ASSERT_FALSE(bus->quiet);
}

TEST(test_hal_estop_reported_by_the_wait_is_read_fully) {
    iwl_hal_waited(&hal, (iwl_reported_t){false, false});
    iwl_hal_waited(&hal, (iwl_reported_t){false, true});
    (void)read_estop();
    TEST_ASSERT_FALSE(was_quiet);
}

TEST(test_hal_wait_counts_for_one_read) {
    iwl_hal_waited(&hal, (iwl_reported_t){false, false});
    (void)read_estop();
    (void)read_estop();
    TEST_ASSERT_FALSE(was_quiet);
}

TEST(test_hal_last_result_is_stored) {
    answer = 1;
    TEST_ASSERT_EQUAL_INT(1, read_estop());
    TEST_ASSERT_EQUAL_INT(1, hal.estop_last);
}

TEST(test_hal_next_time_is_the_earlier_of_bus_and_estop) {
    iwl_bus_t *bus = (iwl_bus_t *)(void *)&hal.bus;
    bus->poll_us = 200;
    estop_due_us = 100;
    TEST_ASSERT_EQUAL_UINT64(100, iwl_hal_next_us(&hal));
    estop_due_us = 300;
    TEST_ASSERT_EQUAL_UINT64(200, iwl_hal_next_us(&hal));
}

static void set_up_two(void) {
    hal.two_contacts = true;
    iw_estop_pair_init(&hal.pair, 200000U);
    hal.now_us = 1000000U;
    answer = 0;
    answer2 = 0;
    reads = 0;
}

int __wrap_iwl_estop_see(const char *name, iwl_estop_seen_t *out_seen);

/// "A" and "a" are one line; "B" is another line of its chip; "C" is a line of another chip; "D" does not exist.
int __wrap_iwl_estop_see(const char *name, iwl_estop_seen_t *out_seen) {
    if (name[0] == 'D') {
        return ENOENT;
    }
    *out_seen = (iwl_estop_seen_t){.offset = (name[0] == 'B') ? 5U : 4U};
    (void)snprintf(out_seen->node, sizeof out_seen->node, "gpiochip%c", (name[0] == 'C') ? '1' : '0');
    return 0;
}

static int open_with(const char *first, const char *second) {
    static iwl_hal_t other;
    const char *cause = NULL;
    const iwl_estop_config_t config = {.name = first, .name2 = second, .discrepancy_ms = 200};
    const int error = iwl_hal_open(&other, "unix:/nowhere/bus", &config, &cause);
    if (error == 0) {
        TEST_ASSERT_TRUE(other.two_contacts);
        iwl_hal_close(&other);
    } else {
        TEST_ASSERT_EQUAL_STRING(second, cause);
    }
    return error;
}

TEST(test_hal_one_line_under_two_names_is_no_second_contact) {
    if (iwl_gpio_estop_ops == NULL) {
        TEST_IGNORE_MESSAGE("without libgpiod");
    }
    TEST_ASSERT_EQUAL_INT(ENOTUNIQ, open_with("A", "a"));
    TEST_ASSERT_EQUAL_INT(ENOTUNIQ, open_with("A", "A"));
    TEST_ASSERT_EQUAL_INT(ENOTUNIQ, open_with("D", "D"));
    TEST_ASSERT_EQUAL_INT(0, open_with("A", "B"));
    TEST_ASSERT_EQUAL_INT(0, open_with("A", "C"));
    TEST_ASSERT_EQUAL_INT(0, open_with("A", "D"));
    TEST_ASSERT_EQUAL_INT(0, open_with("D", "A"));
}

TEST(test_hal_second_contact_with_too_long_names_is_refused) {
    static const char too_long[] = "01234567890123456789012345678901";
    static iwl_hal_t other;
    const char *cause = NULL;
    if (iwl_gpio_estop_ops == NULL) {
        TEST_IGNORE_MESSAGE("without libgpiod");
    }
    const iwl_estop_config_t chip = {.name = "A", .name2 = "B", .discrepancy_ms = 200, .chip2 = too_long};
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, iwl_hal_open(&other, "unix:/nowhere/bus", &chip, &cause));
    TEST_ASSERT_EQUAL_STRING("B", cause);
    const iwl_estop_config_t line = {.name = "A", .name2 = "B", .discrepancy_ms = 200, .chip2_line = too_long};
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, iwl_hal_open(&other, "unix:/nowhere/bus", &line, &cause));
    TEST_ASSERT_EQUAL_STRING("B", cause);
}

TEST(test_hal_second_contact_is_read_at_any_value_of_the_first) {
    set_up_two();
    answer = 1;
    TEST_ASSERT_EQUAL_INT(1, read_estop());
    TEST_ASSERT_EQUAL_UINT(11, reads);
    TEST_ASSERT_EQUAL_INT(1, hal.contact_last[0]);
    TEST_ASSERT_EQUAL_INT(0, hal.contact_last[1]);
    answer = 0;
    answer2 = 1;
    TEST_ASSERT_EQUAL_INT(1, read_estop());
    TEST_ASSERT_EQUAL_INT(1, hal.contact_last[1]);
    answer2 = 0;
    TEST_ASSERT_EQUAL_INT(0, read_estop());
    answer2 = -1;
    TEST_ASSERT_EQUAL_INT(-1, read_estop());
}

TEST(test_hal_contacts_are_judged_at_the_time_of_the_poll) {
    set_up_two();
    answer2 = 1;
    TEST_ASSERT_EQUAL_INT(1, read_estop());
    iwl_hal_poll(&hal, 1200001U);
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, read_estop());
    TEST_ASSERT_EQUAL_INT(IW_ESTOP_DISAGREES, hal.estop_last);
}

TEST(test_hal_each_contact_is_waited_for_polled_and_reported) {
    TEST_ASSERT_EQUAL_INT(10, iwl_hal_estop_fd(&hal));
    TEST_ASSERT_EQUAL_INT(-1, iwl_hal_estop2_fd(&hal));
    TEST_ASSERT_EQUAL_INT(1, iwl_hal_estop_trouble(&hal, 0));
    TEST_ASSERT_EQUAL_INT(0, iwl_hal_estop_trouble(&hal, 1));
    polled = 0;
    iwl_hal_poll(&hal, 1);
    TEST_ASSERT_EQUAL_UINT(1, polled);
    set_up_two();
    iwl_hal_poll(&hal, 2);
    TEST_ASSERT_EQUAL_UINT(12, polled);
    TEST_ASSERT_EQUAL_INT(10, iwl_hal_estop_fd(&hal));
    TEST_ASSERT_EQUAL_INT(20, iwl_hal_estop2_fd(&hal));
    TEST_ASSERT_EQUAL_INT(1, iwl_hal_estop_trouble(&hal, 0));
    TEST_ASSERT_EQUAL_INT(2, iwl_hal_estop_trouble(&hal, 1));
}

TEST(test_hal_each_contact_is_closed) {
    closed = 0;
    iwl_hal_close(&hal);
    TEST_ASSERT_EQUAL_UINT(1, closed);
    set_up_two();
    iwl_hal_close(&hal);
    TEST_ASSERT_EQUAL_UINT(12, closed);
}

TEST(test_hal_next_time_is_the_earliest_of_bus_and_both_contacts) {
    iwl_bus_t *bus = (iwl_bus_t *)(void *)&hal.bus;
    bus->poll_us = 5000000;
    estop_due_us = 4000000;
    estop2_due_us = 3000000;
    TEST_ASSERT_EQUAL_UINT64(4000000, iwl_hal_next_us(&hal));
    set_up_two();
    TEST_ASSERT_EQUAL_UINT64(3000000, iwl_hal_next_us(&hal));
    answer2 = 1;
    (void)read_estop();
    TEST_ASSERT_EQUAL_UINT64(1200001, iwl_hal_next_us(&hal));
    estop_due_us = 1100000;
    TEST_ASSERT_EQUAL_UINT64(1100000, iwl_hal_next_us(&hal));
    bus->poll_us = 1000000;
    TEST_ASSERT_EQUAL_UINT64(1000000, iwl_hal_next_us(&hal));
}
