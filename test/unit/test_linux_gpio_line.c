// SPDX-License-Identifier: MIT
// A GPIO line through libgpiod, the same for both its generations: request, reading, loss and release.
#include "../support/fake_gpio.h"
#include "gpio.h"

#include "unit.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>

fake_gpio_t fake_gpio;

static const iwl_gpio_address_t by_name = {.name = FAKE_GPIO_NAME};
static const iwl_gpio_address_t by_offset = {.name = FAKE_GPIO_CHIP, .offset = FAKE_GPIO_OFFSET, .by_offset = true};
static iwl_gpio_line_t line;

const char *fake_gpio_name(bool own, unsigned offset) {
    const bool twin = (fake_gpio.twin == 1 && own && offset == 30U) || (fake_gpio.twin == 2 && !own && offset == 0U) ||
                      (fake_gpio.twin == 3 && !own && offset == FAKE_GPIO_OFFSET);
    const bool line_itself = own && offset == FAKE_GPIO_OFFSET;
    if (line_itself && fake_gpio.unnamed) {
        return NULL;
    }
    return (twin || line_itself) ? FAKE_GPIO_NAME : (offset % 2U == 0U) ? NULL : "OTHER";
}

const char *fake_gpio_label(void) {
    return (fake_gpio.label != NULL) ? fake_gpio.label : FAKE_GPIO_LABEL;
}

int fake_gpio_take(unsigned max) {
    const int count = (fake_gpio.edges < (int)max) ? fake_gpio.edges : (int)max;
    fake_gpio.reads++;
    if (count == 0 && fake_gpio.edges_error < 0) {
        return 0;
    }
    if (count == 0) {
        errno = (fake_gpio.edges_error != 0) ? fake_gpio.edges_error : EAGAIN;
        return -1;
    }
    fake_gpio.edges -= count;
    return count;
}

void setUp(void) {
    memset(&fake_gpio, 0, sizeof fake_gpio);
    memset(&line, 0xA5, sizeof line);
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_open(&line, &by_name));
}

void tearDown(void) {
    iwl_gpio_line_close(&line);
    TEST_ASSERT_EQUAL_INT(0, fake_gpio.open);
    TEST_ASSERT_EQUAL_INT(0, fake_gpio.requested);
}

TEST(test_line_is_a_pulled_up_input_with_both_edges_nonblocking) {
    TEST_ASSERT_EQUAL_INT(1, fake_gpio.requested);
    TEST_ASSERT_TRUE(fake_gpio.is_input);
    TEST_ASSERT_TRUE(fake_gpio.pulled_up);
    TEST_ASSERT_TRUE(fake_gpio.both_edges);
    TEST_ASSERT_EQUAL_UINT(16U, fake_gpio.buffer_size);
    TEST_ASSERT_EQUAL_INT(fake_gpio.ends[0], line.fd);
    TEST_ASSERT_TRUE((fcntl(line.fd, F_GETFL) & O_NONBLOCK) != 0);
    TEST_ASSERT_EQUAL_UINT(FAKE_GPIO_OFFSET, fake_gpio.offset);
}

TEST(test_line_by_chip_and_offset_is_that_line) {
    iwl_gpio_line_close(&line);
    fake_gpio.offset = 0;
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_open(&line, &by_offset));
    TEST_ASSERT_EQUAL_UINT(FAKE_GPIO_OFFSET, fake_gpio.offset);
    TEST_ASSERT_EQUAL_INT(1, fake_gpio.open);
}

TEST(test_line_level_is_that_of_the_wire_or_an_error) {
    fake_gpio.level = 1;
    TEST_ASSERT_EQUAL_INT(1, iwl_gpio_line_level(&line));
    fake_gpio.level = 0;
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_level(&line));
    fake_gpio.level = -1;
    TEST_ASSERT_TRUE(iwl_gpio_line_level(&line) < 0);
}

TEST(test_line_edges_are_all_read_and_counted) {
    static const int numbers[] = {0, 1, 2, 15, 16, 17, 33};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        fake_gpio.edges = numbers[i];
        TEST_ASSERT_EQUAL_INT(numbers[i], iwl_gpio_line_take_edges(&line));
        TEST_ASSERT_EQUAL_INT(0, fake_gpio.edges);
    }
}

TEST(test_line_endless_edges_need_bounded_reads) {
    fake_gpio.edges = 1000000;
    TEST_ASSERT_GREATER_OR_EQUAL_INT(IWL_GPIO_EDGES_MAX, iwl_gpio_line_take_edges(&line));
    TEST_ASSERT_LESS_OR_EQUAL_INT(IWL_GPIO_EDGES_MAX, fake_gpio.reads);
}

TEST(test_line_edges_of_a_lost_line_are_an_error_eintr_is_none) {
    fake_gpio.edges_error = ENODEV;
    TEST_ASSERT_TRUE(iwl_gpio_line_take_edges(&line) < 0);
    fake_gpio.edges = 3;
    TEST_ASSERT_TRUE(iwl_gpio_line_take_edges(&line) < 0); // Edges that were counted before do not matter.
    fake_gpio.edges_error = EINTR;
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_take_edges(&line));
    fake_gpio.edges = 5;
    fake_gpio.edges_error = -1;
    TEST_ASSERT_EQUAL_INT(5, iwl_gpio_line_take_edges(&line));
}

TEST(test_line_that_cannot_open_returns_errno_and_leaks_nothing) {
    iwl_gpio_line_close(&line);
    fake_gpio.busy_error = EBUSY;
    TEST_ASSERT_EQUAL_INT(EBUSY, iwl_gpio_line_open(&line, &by_name));
    TEST_ASSERT_EQUAL_INT(-1, line.fd);
    TEST_ASSERT_EQUAL_INT(0, fake_gpio.open);
    fake_gpio.busy_error = 0;
    fake_gpio.chip_error = EACCES;
    TEST_ASSERT_EQUAL_INT(EACCES, iwl_gpio_line_open(&line, &by_name));
    TEST_ASSERT_EQUAL_INT(EACCES, iwl_gpio_line_open(&line, &by_offset));
    fake_gpio.chip_error = 0;
    const iwl_gpio_address_t unknown = {.name = "NOBODY"};
    const iwl_gpio_address_t nowhere = {.name = "gpiochip9", .offset = FAKE_GPIO_OFFSET, .by_offset = true};
    TEST_ASSERT_EQUAL_INT(ENOENT, iwl_gpio_line_open(&line, &unknown));
    TEST_ASSERT_EQUAL_INT(ENOENT, iwl_gpio_line_open(&line, &nowhere));
    const iwl_gpio_address_t no_such = {.name = FAKE_GPIO_CHIP, .offset = 99, .by_offset = true};
    const int error = iwl_gpio_line_open(&line, &no_such);
    TEST_ASSERT_TRUE_MESSAGE(error == ENOENT || error == EINVAL, "with the library's error");
    TEST_ASSERT_EQUAL_INT(0, fake_gpio.open);
    TEST_ASSERT_EQUAL_INT(-1, line.fd);
}

TEST(test_line_name_that_exists_twice_is_refused) {
    for (int twin = 1; twin <= 3; twin++) {
        iwl_gpio_line_close(&line);
        fake_gpio.twin = twin;
        TEST_ASSERT_EQUAL_INT(ENOTUNIQ, iwl_gpio_line_open(&line, &by_name));
        TEST_ASSERT_EQUAL_INT(-1, line.fd);
        TEST_ASSERT_EQUAL_INT(0, fake_gpio.open);
        TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_open(&line, &by_offset));
    }
}

TEST(test_line_of_a_chip_with_two_nodes_is_one_line) {
    static const iwl_gpio_address_t linked = {.name = FAKE_GPIO_LINK, .offset = FAKE_GPIO_OFFSET, .by_offset = true};
    const iwl_gpio_address_t *const addresses[] = {&by_name, &by_offset, &linked};
    for (size_t i = 0; i < 2U * sizeof addresses / sizeof addresses[0]; i++) {
        iwl_estop_seen_t seen;
        iwl_gpio_line_close(&line);
        fake_gpio.link = (i % 2U == 0U) ? 1 : 2;
        TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_see(addresses[i / 2U], &seen));
        TEST_ASSERT_EQUAL_STRING(FAKE_GPIO_CHIP, seen.node); // Two names of one line are the same line.
        TEST_ASSERT_EQUAL_UINT(FAKE_GPIO_OFFSET, seen.offset);
        TEST_ASSERT_EQUAL_INT(0, fake_gpio.open);
        TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_open(&line, addresses[i / 2U]));
        TEST_ASSERT_EQUAL_UINT(FAKE_GPIO_OFFSET, fake_gpio.offset);
        TEST_ASSERT_EQUAL_INT(1, fake_gpio.open);
        TEST_ASSERT_EQUAL_INT(1, fake_gpio.requested);
    }
}

TEST(test_line_name_twice_next_to_a_link_is_refused) {
    for (int twin = 1; twin <= 3; twin++) {
        for (fake_gpio.link = 1; fake_gpio.link <= 2; fake_gpio.link++) {
            iwl_gpio_line_close(&line);
            fake_gpio.twin = twin;
            TEST_ASSERT_EQUAL_INT(ENOTUNIQ, iwl_gpio_line_open(&line, &by_name));
            TEST_ASSERT_EQUAL_INT(-1, line.fd);
            TEST_ASSERT_EQUAL_INT(0, fake_gpio.open);
        }
    }
}

TEST(test_line_with_unexpected_names_is_refused) {
    static const struct {
        iwl_estop_seen_t expected;
        int error;
    } cases[] = {{{.chip = "", .line = ""}, 0},
                 {{.chip = FAKE_GPIO_LABEL, .line = ""}, 0},
                 {{.chip = "", .line = FAKE_GPIO_NAME}, 0},
                 {{.chip = FAKE_GPIO_LABEL, .line = FAKE_GPIO_NAME}, 0},
                 {{.chip = "another-chip", .line = FAKE_GPIO_NAME}, EREMCHG},
                 {{.chip = FAKE_GPIO_LABEL, .line = "OTHER"}, EREMCHG},
                 {{.chip = "pinctrl-fak", .line = ""}, EREMCHG},
                 {{.chip = "pinctrl-fake2", .line = ""}, EREMCHG}};
    const iwl_gpio_address_t *const addresses[] = {&by_name, &by_offset};
    for (size_t i = 0; i < 2U * sizeof cases / sizeof cases[0]; i++) {
        iwl_gpio_address_t address = *addresses[i % 2U];
        address.expected = cases[i / 2U].expected;
        iwl_gpio_line_close(&line);
        TEST_ASSERT_EQUAL_INT(cases[i / 2U].error, iwl_gpio_line_open(&line, &address));
        TEST_ASSERT_EQUAL_STRING((cases[i / 2U].error == 0) ? FAKE_GPIO_LABEL : "", line.seen.chip);
        TEST_ASSERT_EQUAL_STRING((cases[i / 2U].error == 0) ? FAKE_GPIO_NAME : "", line.seen.line);
        TEST_ASSERT_EQUAL_INT((cases[i / 2U].error == 0) ? 1 : 0, fake_gpio.open);
        TEST_ASSERT_EQUAL_INT((cases[i / 2U].error == 0) ? 1 : 0, fake_gpio.requested);
    }
}

TEST(test_line_of_a_renumbered_chip_is_refused) {
    iwl_gpio_address_t address = by_offset;
    address.expected = (iwl_estop_seen_t){.chip = FAKE_GPIO_LABEL};
    iwl_gpio_line_close(&line);
    fake_gpio.label = "raspberrypi-exp-gpio"; // Another chip has the number now.
    TEST_ASSERT_EQUAL_INT(EREMCHG, iwl_gpio_line_open(&line, &address));
    TEST_ASSERT_EQUAL_INT(-1, line.fd);
    address.expected = (iwl_estop_seen_t){.line = FAKE_GPIO_NAME};
    fake_gpio.unnamed = true;
    TEST_ASSERT_EQUAL_INT(EREMCHG, iwl_gpio_line_open(&line, &address));
}

TEST(test_line_lookup_returns_names_without_a_request) {
    const iwl_gpio_address_t *const addresses[] = {&by_name, &by_offset};
    for (size_t i = 0; i < 2U; i++) {
        iwl_estop_seen_t seen = {.chip = "x", .line = "y"};
        iwl_gpio_line_close(&line);
        fake_gpio.busy_error = EBUSY; // Another process holds the line.
        TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_see(addresses[i], &seen));
        TEST_ASSERT_EQUAL_STRING(FAKE_GPIO_LABEL, seen.chip);
        TEST_ASSERT_EQUAL_STRING(FAKE_GPIO_NAME, seen.line);
        TEST_ASSERT_EQUAL_STRING(FAKE_GPIO_CHIP, seen.node);
        TEST_ASSERT_EQUAL_UINT(FAKE_GPIO_OFFSET, seen.offset);
        TEST_ASSERT_EQUAL_INT(0, fake_gpio.open);
        TEST_ASSERT_EQUAL_INT(0, fake_gpio.requested);
    }
    iwl_estop_seen_t seen;
    fake_gpio.unnamed = true;
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_see(&by_offset, &seen));
    TEST_ASSERT_EQUAL_STRING("", seen.line);
    fake_gpio.unnamed = false;
    fake_gpio.twin = 2;
    TEST_ASSERT_EQUAL_INT(ENOTUNIQ, iwl_gpio_line_see(&by_name, &seen));
    const iwl_gpio_address_t unknown = {.name = "NOBODY"};
    TEST_ASSERT_EQUAL_INT(ENOENT, iwl_gpio_line_see(&unknown, &seen));
    TEST_ASSERT_EQUAL_INT(0, fake_gpio.open);
}

TEST(test_line_that_is_closed_can_be_opened_again) {
    iwl_gpio_line_close(&line);
    TEST_ASSERT_EQUAL_INT(-1, line.fd);
    TEST_ASSERT_EQUAL_INT(0, fake_gpio.requested);
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_line_open(&line, &by_name));
}
