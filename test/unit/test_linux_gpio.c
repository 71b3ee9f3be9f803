// SPDX-License-Identifier: MIT
// The address of a GPIO line, and when its button counts as released.
#include "gpio.h"

#include "unit.h"

#include <errno.h>
#include <string.h>

#define MS       1000U
#define START_US UINT64_C(5000000)

static iwl_gpio_address_t address;
static iwl_gpio_release_t release;
static iw_time_us_t now_us;

void setUp(void) {
    memset(&address, 0xA5, sizeof address);
    memset(&release, 0xA5, sizeof release);
    iwl_gpio_release_init(&release, 5U * MS);
    now_us = START_US;
}

TEST(test_address_by_chip_and_offset_is_parsed) {
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_address_parse("gpiochip0:4", &address));
    TEST_ASSERT_TRUE(address.by_offset);
    TEST_ASSERT_EQUAL_STRING("gpiochip0", address.name);
    TEST_ASSERT_EQUAL_UINT(4, address.offset);
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_address_parse("gpiochip12:65535", &address));
    TEST_ASSERT_EQUAL_STRING("gpiochip12", address.name);
    TEST_ASSERT_EQUAL_UINT(65535, address.offset);
}

TEST(test_address_by_name_is_parsed) {
    static const char *const names[] = {"ESTOP", "GPIO17", "gpiochip0", "a:4", "gpio:4", "none2", "a b", "x"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, iwl_gpio_address_parse(names[i], &address), names[i]);
        TEST_ASSERT_FALSE_MESSAGE(address.by_offset, names[i]);
        TEST_ASSERT_EQUAL_STRING(names[i], address.name);
    }
}

TEST(test_address_invalid_is_refused_and_changes_nothing) {
    static const char *const wrong[] = {"",
                                        "gpiochip:4",
                                        "gpiochip0:",
                                        "gpiochip0:x",
                                        "gpiochip0:4x",
                                        "gpiochip0:-1",
                                        "gpiochip0: 4",
                                        "gpiochip0:65536",
                                        "gpiochip0:99999999999999999999",
                                        "gpiochipx:4",
                                        "gpiochip0:4:5",
                                        "gpiochip99999999999999999999:1"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(EINVAL, iwl_gpio_address_parse(wrong[i], &address), wrong[i]);
    }
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, iwl_gpio_address_parse("a-line-name-of-thirty-two-letters", &address));
    TEST_ASSERT_EACH_EQUAL_HEX8(0xA5, &address, sizeof address);
}

TEST(test_address_with_the_longest_name_fits) {
    TEST_ASSERT_EQUAL_INT(0, iwl_gpio_address_parse("a-line-name-of-31-letters-xxxxx", &address));
    TEST_ASSERT_EQUAL_size_t(31, strlen(address.name));
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, iwl_gpio_address_parse("a-line-name-of-32-letters-xxxxxx", &address));
}

static void poll_at(uint32_t after_us, bool active, bool edge) {
    now_us += after_us;
    iwl_gpio_release_see(&release, now_us, active, edge);
}

static bool pressed(void) {
    return iwl_gpio_release_take_pressed(&release, now_us);
}

TEST(test_release_line_inactive_at_start_is_released) {
    poll_at(0, false, false);
    TEST_ASSERT_FALSE(pressed());
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iwl_gpio_release_next_us(&release, now_us));
}

TEST(test_release_press_counts_immediately) {
    poll_at(0, true, false);
    TEST_ASSERT_TRUE(pressed());
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iwl_gpio_release_next_us(&release, now_us));
    setUp();
    poll_at(0, true, true);
    TEST_ASSERT_TRUE(pressed());
}

TEST(test_release_counts_after_the_debounce_time) {
    poll_at(0, true, true);
    (void)pressed();
    poll_at(1000U * MS, false, true);
    TEST_ASSERT_TRUE(pressed());
    TEST_ASSERT_EQUAL_UINT64(now_us + 5U * MS, iwl_gpio_release_next_us(&release, now_us));
    poll_at(5U * MS - 1U, false, false);
    TEST_ASSERT_TRUE(pressed());
    poll_at(1U, false, false);
    TEST_ASSERT_FALSE(pressed());
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iwl_gpio_release_next_us(&release, now_us));
}

TEST(test_release_is_delayed_by_every_bounce) {
    poll_at(0, true, true);
    (void)pressed();
    for (unsigned bounce = 0; bounce < 20U; bounce++) {
        poll_at(4U * MS, (bounce & 1U) != 0U, true);
        TEST_ASSERT_TRUE(pressed());
    }
    poll_at(4U * MS, false, true);
    poll_at(4U * MS, false, true);
    poll_at(5U * MS - 1U, false, false);
    TEST_ASSERT_TRUE(pressed());
    poll_at(1U, false, false);
    TEST_ASSERT_FALSE(pressed());
}

TEST(test_release_pulse_between_two_polls_is_a_press) {
    poll_at(0, false, false);
    (void)pressed();
    poll_at(20U * MS, false, true);
    TEST_ASSERT_TRUE(pressed());
    poll_at(5U * MS, false, false);
    TEST_ASSERT_FALSE(pressed());
}

TEST(test_release_edge_is_reported_once_at_a_late_read) {
    poll_at(0, false, true);
    now_us += 1000U * MS;
    TEST_ASSERT_TRUE(pressed());
    TEST_ASSERT_FALSE(pressed());
}

TEST(test_release_edge_before_a_second_poll_is_reported_once) {
    poll_at(0, false, true);
    poll_at(10U * MS, false, false);
    now_us += 1000U * MS;
    TEST_ASSERT_TRUE(pressed());
    TEST_ASSERT_FALSE(pressed());
}

TEST(test_release_short_active_level_without_edge_is_reported) {
    poll_at(0, true, false);
    poll_at(10U * MS, false, false);
    now_us += 1000U * MS;
    TEST_ASSERT_TRUE(pressed());
    TEST_ASSERT_FALSE(pressed());
}

TEST(test_release_without_debounce_follows_the_level) {
    iwl_gpio_release_init(&release, 0);
    poll_at(0, true, true);
    TEST_ASSERT_TRUE(pressed());
    poll_at(1U, false, true);
    TEST_ASSERT_TRUE(pressed());
    TEST_ASSERT_FALSE(pressed());
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iwl_gpio_release_next_us(&release, now_us));
}
