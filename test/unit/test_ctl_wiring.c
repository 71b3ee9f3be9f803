// SPDX-License-Identifier: MIT
// bringup: the stored wiring of the e-stop line, read from a port that the test plays.
#include "bringup/bringup.h"

#include "iwheel_linux/backend.h"

#include "unit.h"

#include <errno.h>
#include <string.h>

int __wrap_iwl_estop_see(const char *name, iwl_estop_seen_t *out_seen);

static bringup_t bringup;
static iwl_estop_seen_t seen;
static iwl_estop_seen_t seen2;
static int error;

int __wrap_iwl_estop_see(const char *name, iwl_estop_seen_t *out_seen) {
    const bool second = strcmp(name, "ESTOP2") == 0;
    TEST_ASSERT_EQUAL_STRING(second ? "ESTOP2" : "ESTOP", name);
    *out_seen = second ? seen2 : seen;
    return second ? 0 : error;
}

void setUp(void) {
    memset(&bringup, 0, sizeof bringup);
    gateway_config_default(&bringup.config);
    seen = (iwl_estop_seen_t){.chip = "pinctrl-bcm2711", .line = "ESTOP"};
    seen2 = (iwl_estop_seen_t){.chip = "expander", .line = "P7"};
    error = 0;
}

static void stored(const char *chip, const char *line, unsigned notes) {
    bringup_store_wiring(&bringup);
    TEST_ASSERT_EQUAL_STRING(chip, bringup.config.estop.chip);
    TEST_ASSERT_EQUAL_STRING(line, bringup.config.estop.chip_line);
    TEST_ASSERT_EQUAL_UINT(notes, bringup.notes);
    TEST_ASSERT_EQUAL_STRING("any", bringup.config.estop.chip2);
    TEST_ASSERT_EQUAL_STRING("any", bringup.config.estop.chip2_line);
}

TEST(test_wiring_is_stored_with_one_note_per_name) {
    stored("pinctrl-bcm2711", "ESTOP", 2);
}

TEST(test_wiring_of_unnamed_line_stores_the_chip_only) {
    seen.line[0] = '\0';
    stored("pinctrl-bcm2711", "any", 1);
}

TEST(test_wiring_unreadable_is_not_stored) {
    error = ENOTSUP;
    stored("any", "any", 0);
}

TEST(test_wiring_name_invalid_in_configuration_is_not_stored) {
    strcpy(seen.chip, "a;b");
    stored("any", "ESTOP", 1);
}

static void use_two_contacts(void) {
    strcpy(bringup.config.estop.line2, "ESTOP2");
}

TEST(test_wiring_of_both_contacts_is_stored) {
    use_two_contacts();
    bringup_store_wiring(&bringup);
    TEST_ASSERT_EQUAL_STRING("pinctrl-bcm2711", bringup.config.estop.chip);
    TEST_ASSERT_EQUAL_STRING("ESTOP", bringup.config.estop.chip_line);
    TEST_ASSERT_EQUAL_STRING("expander", bringup.config.estop.chip2);
    TEST_ASSERT_EQUAL_STRING("P7", bringup.config.estop.chip2_line);
    TEST_ASSERT_EQUAL_UINT(4, bringup.notes);
}

TEST(test_wiring_of_an_earlier_bringup_is_reset) {
    use_two_contacts();
    bringup_store_wiring(&bringup);
    bringup_forget_wiring(&bringup);
    TEST_ASSERT_EQUAL_STRING("any", bringup.config.estop.chip2);
    TEST_ASSERT_EQUAL_STRING("any", bringup.config.estop.chip2_line);
    TEST_ASSERT_EQUAL_STRING("any", bringup.config.estop.chip);
    TEST_ASSERT_EQUAL_STRING("any", bringup.config.estop.chip_line);
}
