// SPDX-License-Identifier: MIT
// The e-stop on a fake GPIO line: presses, pulses, a chip that disappears and returns, a line that another process
// holds.
#include "gpio.h"

#include "iwheel_linux/backend.h"

#include "unit.h"

#include <errno.h>
#include <poll.h>
#include <stdint.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <unistd.h>

#define MS 1000U

static struct {
    int level; ///< -1: cannot be read.
    int edges; ///< -1: the chip is absent.
    int open_error;
    int opened;
    int fd;
    iwl_estop_seen_t expected;
} wire;

static iwl_backend_store_t store;
static iw_time_us_t now_us;

int iwl_gpio_line_see(const iwl_gpio_address_t *address, iwl_estop_seen_t *out_seen) {
    (void)address;
    *out_seen = (iwl_estop_seen_t){.chip = "label", .line = "name"};
    return 0;
}

int iwl_gpio_line_open(iwl_gpio_line_t *self, const iwl_gpio_address_t *address) {
    wire.expected = address->expected;
    *self = (iwl_gpio_line_t){.fd = -1};
    wire.opened++;
    if (wire.open_error != 0) {
        return wire.open_error;
    }
    wire.fd = self->fd = eventfd(0, EFD_NONBLOCK);
    self->seen = (iwl_estop_seen_t){.chip = "label", .line = "name"};
    return 0;
}

void iwl_gpio_line_close(iwl_gpio_line_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    *self = (iwl_gpio_line_t){.fd = -1};
}

int iwl_gpio_line_level(const iwl_gpio_line_t *self) {
    (void)self;
    return wire.level;
}

int iwl_gpio_line_take_edges(iwl_gpio_line_t *self) {
    const int edges = wire.edges;
    (void)self;
    wire.edges = (edges > 0) ? 0 : edges;
    return edges;
}

static void poll_after(unsigned after_ms) {
    now_us += (iw_time_us_t)after_ms * MS;
    iwl_gpio_estop_ops->poll(&store, now_us);
}

/// Reads the e-stop after a wait that has reported edges, if there are any.
static int pressed(void) {
    return iwl_gpio_estop_ops->pressed(&store, wire.edges == 0);
}

static void assert_pressed_after(unsigned after_ms, int expected) {
    poll_after(after_ms);
    TEST_ASSERT_EQUAL_INT(expected, pressed());
}

/// The line changes to this level, with an edge.
static void change_level(int level) {
    wire.level = level;
    wire.edges = 1;
}

static void begin(bool active_high) {
    const iwl_estop_config_t config = {.name = "ESTOP", .active_high = active_high, .debounce_ms = 5};
    wire.level = active_high ? 0 : 1;
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_estop_ops->open(&store, &config));
    poll_after(0);
}

void setUp(void) {
    now_us = 7000000;
    wire.edges = wire.open_error = wire.opened = 0;
    begin(false);
}

void tearDown(void) {
    iwl_gpio_estop_ops->close(&store);
}

TEST(test_estop_line_low_is_pressed_and_high_is_released) {
    TEST_ASSERT_EQUAL_INT(0, pressed());
    change_level(0);
    assert_pressed_after(1, 1);
    assert_pressed_after(100, 1);
    change_level(1);
    assert_pressed_after(1, 1);
    TEST_ASSERT_EQUAL_UINT64(now_us + 5U * MS, iwl_gpio_estop_ops->next_us(&store));
    assert_pressed_after(5, 0);
}

TEST(test_estop_line_active_high_is_pressed_when_high) {
    tearDown();
    begin(true);
    TEST_ASSERT_EQUAL_INT(0, pressed());
    change_level(1);
    assert_pressed_after(1, 1);
}

TEST(test_estop_level_is_read_without_a_report_of_the_wait) {
    TEST_ASSERT_EQUAL_INT(0, pressed());
    wire.level = 0;
    poll_after(1);
    TEST_ASSERT_EQUAL_INT(1, iwl_gpio_estop_ops->pressed(&store, true));
}

TEST(test_estop_pulse_with_only_its_edges_left_is_a_press) {
    TEST_ASSERT_EQUAL_INT(0, pressed());
    wire.edges = 2;
    assert_pressed_after(1, 1);
    assert_pressed_after(5, 0);
}

TEST(test_estop_chip_lost_is_unreadable_by_level_and_by_edges) {
    wire.level = -1;
    assert_pressed_after(1, -1);
    TEST_ASSERT_EQUAL_INT(ENODEV, iwl_gpio_estop_ops->trouble(&store));
    wire.level = 1;
    poll_after(200);
    (void)pressed();
    TEST_ASSERT_EQUAL_INT(0, pressed());
    wire.edges = -1;
    assert_pressed_after(1, -1);
}

TEST(test_estop_chip_lost_and_back_is_released_again) {
    wire.level = -1;
    assert_pressed_after(1, -1);
    TEST_ASSERT_EQUAL_INT(-1, pressed());
    wire.level = 1;
    assert_pressed_after(200, 0);
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_estop_ops->trouble(&store));
}

TEST(test_estop_lost_chip_is_retried_every_200_ms) {
    wire.level = -1;
    poll_after(1);
    (void)pressed();
    wire.open_error = ENOENT;
    wire.opened = 0;
    for (unsigned ms = 0; ms < 1000U; ms++) {
        assert_pressed_after(1, -1);
        TEST_ASSERT_TRUE(iwl_gpio_estop_ops->next_us(&store) > now_us);
        TEST_ASSERT_TRUE(iwl_gpio_estop_ops->next_us(&store) <= now_us + 200U * MS);
    }
    TEST_ASSERT_EQUAL_INT(5, wire.opened);
    TEST_ASSERT_EQUAL_INT(ENOENT, iwl_gpio_estop_ops->trouble(&store));
}

TEST(test_estop_line_busy_at_start_is_unreadable_until_it_opens) {
    tearDown();
    wire.open_error = EBUSY;
    begin(false);
    TEST_ASSERT_EQUAL_INT(-1, pressed());
    TEST_ASSERT_EQUAL_INT(EBUSY, iwl_gpio_estop_ops->trouble(&store));
    wire.open_error = 0;
    assert_pressed_after(200, 0);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iwl_gpio_estop_ops->next_us(&store));
}

TEST(test_estop_line_with_another_name_counts_as_pressed) {
    tearDown();
    wire.open_error = EREMCHG;
    begin(false);
    TEST_ASSERT_EQUAL_INT(-1, pressed());
    TEST_ASSERT_EQUAL_INT(EREMCHG, iwl_gpio_estop_ops->trouble(&store));
    assert_pressed_after(1000, -1);
}

TEST(test_estop_line_has_names_while_it_is_readable) {
    const iwl_estop_seen_t *seen = iwl_gpio_estop_ops->seen(&store);
    TEST_ASSERT_NOT_NULL(seen);
    TEST_ASSERT_EQUAL_STRING("label", seen->chip);
    TEST_ASSERT_EQUAL_STRING("name", seen->line);
    wire.level = -1;
    TEST_ASSERT_EQUAL_INT(-1, pressed());
    TEST_ASSERT_NULL(iwl_gpio_estop_ops->seen(&store));
}

TEST(test_estop_expects_configured_names_and_none_for_any) {
    static const char *const longest = "0123456789012345678901234567890";
    static const struct {
        const char *chip;
        const char *chip_line;
        iwl_estop_seen_t expected;
    } cases[] = {{NULL, NULL, {.chip = "", .line = ""}},
                 {"any", "any", {.chip = "", .line = ""}},
                 {"pinctrl", "any", {.chip = "pinctrl", .line = ""}},
                 {"any", "GPIO4", {.chip = "", .line = "GPIO4"}}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const iwl_estop_config_t config = {.name = "ESTOP", .chip = cases[i].chip, .chip_line = cases[i].chip_line};
        tearDown();
        TEST_ASSERT_EQUAL_INT(0, iwl_gpio_estop_ops->open(&store, &config));
        TEST_ASSERT_EQUAL_STRING(cases[i].expected.chip, wire.expected.chip);
        TEST_ASSERT_EQUAL_STRING(cases[i].expected.line, wire.expected.line);
    }
    tearDown();
    iwl_estop_config_t config = {.name = "ESTOP", .chip = longest};
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_estop_ops->open(&store, &config));
    TEST_ASSERT_EQUAL_STRING(longest, wire.expected.chip);
    tearDown();
    config.chip = "01234567890123456789012345678901";
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, iwl_gpio_estop_ops->open(&store, &config));
    begin(false);
}

TEST(test_estop_without_a_line_has_no_name) {
    iwl_estop_seen_t seen;
    TEST_ASSERT_EQUAL_INT(ENOTSUP, iwl_estop_see("unix:/tmp/button", &seen));
    TEST_ASSERT_EQUAL_INT(EINVAL, iwl_estop_see("gpiochip:4", &seen));
    TEST_ASSERT_EQUAL_INT(0, iwl_estop_see("gpiochip0:4", &seen));
    TEST_ASSERT_EQUAL_STRING("label", seen.chip);
}

TEST(test_estop_descriptor_wakes_for_the_line_that_is_open_now) {
    const uint64_t one = 1;
    struct pollfd wait = {.fd = iwl_gpio_estop_ops->watch_fd(&store), .events = POLLIN};
    TEST_ASSERT_EQUAL_INT(0, poll(&wait, 1, 0));
    wire.level = -1;
    poll_after(1);
    (void)pressed();
    wire.level = 1;
    poll_after(200);
    TEST_ASSERT_EQUAL_INT((int)sizeof one, (int)write(wire.fd, &one, sizeof one));
    TEST_ASSERT_EQUAL_INT(1, poll(&wait, 1, 0));
}

TEST(test_estop_without_a_free_descriptor_is_refused) {
    struct rlimit before;
    tearDown();
    TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_NOFILE, &before));
    const struct rlimit none = {.rlim_cur = 0, .rlim_max = before.rlim_max};
    const iwl_estop_config_t config = {.name = "ESTOP"};
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_NOFILE, &none));
    const int error = iwl_gpio_estop_ops->open(&store, &config);
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_NOFILE, &before));
    TEST_ASSERT_EQUAL_INT(EMFILE, error);
    begin(false);
}
