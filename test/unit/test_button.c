// SPDX-License-Identifier: MIT
// E-stop button: which presses prove that it works, what makes the proof void, and what is stored.
#include "assumptions/assumptions_file.h"
#include "assumptions/button.h"

#include "unit.h"

#include <string.h>

#define MS(value) ((iw_time_us_t)(value)*1000U)

static iwl_estop_seen_t seen;
static iwl_estop_seen_t seen2;
static bool readable;
static bool readable2;
static unsigned names_read;
static iwl_estop_ops_t ops;
static iwl_hal_t hal;

static const iwl_estop_seen_t *fake_seen(const void *self) {
    const bool second = self == &hal.estop2;
    names_read++;
    return !(second ? readable2 : readable) ? NULL : second ? &seen2 : &seen;
}

static gw_button_t button;
static gw_tried_t tried;
static iw_time_us_t now_us;

void setUp(void) {
    seen = (iwl_estop_seen_t){.chip = "pinctrl-bcm2711", .line = "GPIO4"};
    seen2 = (iwl_estop_seen_t){.chip = "pinctrl-bcm2711", .line = "GPIO5"};
    readable = true;
    readable2 = true;
    ops = (iwl_estop_ops_t){.seen = fake_seen, .present = true};
    hal = (iwl_hal_t){.estop_ops = &ops};
    button = (gw_button_t){.contact = {{"ESTOP", true}, {"none", true}}};
    memset(&tried, 0, sizeof tried);
    now_us = MS(5000);
}

/// Holds an answer for a time; the button is polled every 10 ms.
static gw_button_news_t hold(int answer, unsigned for_ms) {
    gw_button_news_t news = GW_BUTTON_NO_NEWS;
    for (unsigned ms = 0; ms < for_ms; ms += 10U) {
        hal.contact_last[0] = answer;
        const gw_button_news_t one = gw_button_poll(&button, &hal, now_us, &tried);
        news = (one != GW_BUTTON_NO_NEWS) ? one : news;
        now_us += MS(10);
    }
    return news;
}

TEST(test_button_press_and_release_proves_this_wiring) {
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 100));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(1, 1000));
    TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold(0, 10));
    TEST_ASSERT_TRUE(tried.wall_us > 0);
    TEST_ASSERT_TRUE(tried.contact[0].active_high);
    TEST_ASSERT_EQUAL_STRING("ESTOP", tried.contact[0].line);
    TEST_ASSERT_EQUAL_STRING("pinctrl-bcm2711", tried.contact[0].seen.chip);
    TEST_ASSERT_EQUAL_STRING("GPIO4", tried.contact[0].seen.line);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 1000));
}

TEST(test_button_press_counts_from_50_ms_on) {
    (void)hold(0, 10);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(1, 40));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 100));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(1, 50));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold(0, 10));
}

/// A release is reported late by the debounce time. This time is not part of the press.
TEST(test_button_debounce_time_is_not_part_of_the_press) {
    button.debounce_us = MS(100);
    (void)hold(0, 10);
    (void)hold(1, 140);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 100));
    (void)hold(1, 150);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold(0, 10));
}

TEST(test_button_pressed_at_start_proves_nothing) {
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(1, 1000));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 1000));
    TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
}

TEST(test_button_unreadable_or_absent_ends_the_press) {
    (void)hold(0, 10);
    (void)hold(1, 1000);
    (void)hold(-1, 10);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 100));
    (void)hold(1, 1000);
    readable = false; // Absent and present again between two polls, which is reported.
    (void)hold(-1, 10);
    readable = true;
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 100));
    TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
}

static void press(void) {
    (void)hold(0, 10);
    (void)hold(1, 1000);
    (void)hold(0, 10);
}

TEST(test_button_simulated_or_absent_proves_nothing) {
    ops.simulated = true;
    press();
    TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
    ops.simulated = false;
    ops.present = false;
    press();
    TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
    ops.present = true;
    ops.seen = NULL;
    press();
    TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
}

TEST(test_button_proof_is_void_after_any_change_of_wiring) {
    for (unsigned change = 0; change < 4U; change++) {
        setUp();
        press();
        TEST_ASSERT_TRUE(tried.wall_us > 0);
        TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 100));
        (void)hold(-1, 10); // The wiring changes while the contact is unreadable.
        button.contact[0].line = (change == 0U) ? "gpiochip0:4" : button.contact[0].line;
        button.contact[0].active_high = (change == 1U) ? false : button.contact[0].active_high;
        (void)snprintf(seen.chip, sizeof seen.chip, "%s", (change == 2U) ? "gpio-sim" : "pinctrl-bcm2711");
        (void)snprintf(seen.line, sizeof seen.line, "%s", (change == 3U) ? "GPIO5" : "GPIO4");
        TEST_ASSERT_EQUAL_INT(GW_BUTTON_VOID, hold(0, 10));
        TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
        TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 100));
    }
}

TEST(test_button_proof_is_not_void_while_line_is_unreadable) {
    press();
    const int64_t before = tried.wall_us;
    readable = false;
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(-1, 100));
    TEST_ASSERT_EQUAL_INT64(before, tried.wall_us);
}

/// A button with two contacts.
static void set_up_two(void) {
    setUp();
    hal.two_contacts = true;
    button.contact[1].line = "50%%2"; // Any name of a line
}

static gw_button_news_t hold_both(int first, int second, unsigned for_ms) {
    hal.contact_last[1] = second;
    return hold(first, for_ms);
}

TEST(test_button_two_contacts_proved_by_a_press_of_both) {
    set_up_two();
    (void)hold_both(0, 0, 10);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(1, 0, 1000));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100)); // Only the first contact
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 1, 1000));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100)); // Only the second contact
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(1, 0, 100));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(1, 1, 40));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100)); // Both contacts, but for less than 50 ms
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(1, 1, 100));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 1, 100));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold_both(0, 0, 10));
    TEST_ASSERT_EQUAL_STRING("50%%2", tried.contact[1].line);
    TEST_ASSERT_EQUAL_STRING("GPIO5", tried.contact[1].seen.line);
    TEST_ASSERT_TRUE(tried.contact[1].active_high);
}

/// The time during which both contacts are pressed counts, not the time until the last release.
TEST(test_button_two_contacts_short_overlap_proves_nothing) {
    for (int first = 0; first < 2; first++) {
        set_up_two();
        (void)hold_both(0, 0, 10);
        (void)hold_both(1, 1, 40);
        (void)hold_both(first, 1 - first, 1000);
        TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100));
        (void)hold_both(1, 1, 40);
        (void)hold_both(first, 1 - first, 100);
        (void)hold_both(1, 1, 40); // Again 40 ms
        TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100));
        (void)hold_both(1, 1, 50);
        (void)hold_both(first, 1 - first, 10);
        (void)hold_both(1, 1, 10); // One overlap was long enough.
        TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold_both(0, 0, 10));
    }
}

/// A press of both contacts that begins before the start proves nothing, even if one contact changes.
TEST(test_button_two_contacts_pressed_at_start_proves_nothing) {
    set_up_two();
    (void)hold_both(1, 1, 1000);
    (void)hold_both(0, 1, 100);
    (void)hold_both(1, 1, 1000);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100));
}

TEST(test_button_two_contacts_one_unreadable_proves_nothing) {
    set_up_two();
    (void)hold_both(0, 0, 10);
    (void)hold_both(1, 1, 100);
    (void)hold_both(1, -1, 10);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100));
    (void)hold_both(1, 1, 100);
    readable2 = false;
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100));
}

TEST(test_button_proof_is_void_with_another_second_contact) {
    for (unsigned change = 0; change < 4U; change++) {
        set_up_two();
        (void)hold_both(0, 0, 10);
        (void)hold_both(1, 1, 100);
        TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold_both(0, 0, 10));
        (void)hold_both(0, -1, 10);
        button.contact[1].line = (change == 0U) ? "gpiochip0:5" : "50%%2";
        button.contact[1].active_high = change != 1U;
        (void)snprintf(seen2.chip, sizeof seen2.chip, "%s", (change == 2U) ? "gpio-sim" : "pinctrl-bcm2711");
        (void)snprintf(seen2.line, sizeof seen2.line, "%s", (change == 3U) ? "GPIO6" : "GPIO5");
        TEST_ASSERT_EQUAL_INT(GW_BUTTON_VOID, hold_both(0, 0, 10));
    }
}

TEST(test_button_proof_is_void_if_number_of_contacts_changes) {
    press();
    TEST_ASSERT_TRUE(tried.wall_us > 0);
    button = (gw_button_t){.contact = {{"ESTOP", true}, {"ESTOP2", true}}}; // The gateway starts again.
    hal.two_contacts = true;
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_VOID, hold_both(0, 0, 10));
    (void)hold_both(1, 1, 100);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold_both(0, 0, 10));
    button = (gw_button_t){.contact = {{"ESTOP", true}, {"none", true}}};
    hal.two_contacts = false;
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_VOID, hold_both(0, 0, 10));
}

/// If one contact is stuck, both read released at the next start: only the stored state can cause a warning.
TEST(test_button_proof_is_void_after_contacts_disagree) {
    set_up_two();
    (void)hold_both(0, 0, 10);
    (void)hold_both(1, 1, 100);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold_both(0, 0, 10));
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(1, 0, 100));
    hal.estop_last = IW_ESTOP_DISAGREES; // The limit of time has passed.
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_BROKEN, hold_both(1, 0, 100));
    TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100));
    (void)hold_both(1, 1, 100);
    (void)hold_both(1, 0, 300); // The fault occurs again.
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold_both(0, 0, 100));
    TEST_ASSERT_EQUAL_INT64(0, tried.wall_us);
    (void)hold_both(1, 1, 100);
    hal.estop_last = 0;
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_TRIED, hold_both(0, 0, 10));
}

TEST(test_button_stored_without_second_contact_has_one) {
    press();
    tried.contact[1].line[0] = '\0';
    button = (gw_button_t){.contact = {{"ESTOP", true}, {"none", false}}};
    TEST_ASSERT_EQUAL_INT(GW_BUTTON_NO_NEWS, hold(0, 10));
    TEST_ASSERT_TRUE(tried.wall_us > 0);
}

TEST(test_button_names_are_read_only_after_a_change) {
    (void)hold(0, 10);
    names_read = 0;
    (void)hold(0, 1000);
    TEST_ASSERT_EQUAL_UINT(0, names_read);
    (void)hold(1, 10);
    TEST_ASSERT_EQUAL_UINT(1, names_read);
}

static bool stored_is_read(const gw_stored_t *known, gw_stored_t *out_known) {
    static char text[GW_ASSUMPTIONS_FILE_SIZE];
    char reason[GW_ASSUMPTIONS_REASON_SIZE];
    const size_t length = gw_assumptions_file_write(known, "can0", text, sizeof text);
    return length > 0U && gw_assumptions_file_read(text, length, "can0", out_known, reason);
}

TEST(test_button_proof_is_stored_and_read_back) {
    static gw_stored_t known;
    static gw_stored_t got;
    memset(&known, 0, sizeof known);
    known.tried = (gw_tried_t){.wall_us = 1, .contact[0].active_high = true};
    memset(known.tried.contact[0].line, 'l', sizeof known.tried.contact[0].line - 1U);
    memset(known.tried.contact[0].seen.chip, 'c', sizeof known.tried.contact[0].seen.chip - 1U);
    memset(known.tried.contact[0].seen.line, 'n', sizeof known.tried.contact[0].seen.line - 1U);
    known.tried.contact[1] = known.tried.contact[0];
    known.tried.contact[1].active_high = false;
    known.tried.contact[1].line[0] = '2';
    TEST_ASSERT_TRUE(stored_is_read(&known, &got));
    TEST_ASSERT_EQUAL_MEMORY(&known.tried, &got.tried, sizeof got.tried);
    known.tried.contact[0].active_high = false;
    TEST_ASSERT_TRUE(stored_is_read(&known, &got));
    TEST_ASSERT_FALSE(got.tried.contact[0].active_high);
    memset(&known, 0, sizeof known);
    TEST_ASSERT_TRUE(stored_is_read(&known, &got));
    TEST_ASSERT_EQUAL_INT64(0, got.tried.wall_us);
    known.tried.wall_us = -1;
    TEST_ASSERT_FALSE(stored_is_read(&known, &got));
}

/// Each member is required and has its own type.
TEST(test_button_stored_with_wrong_members_is_refused) {
    static const char *const members[] = {
        "{\"line\":\"a\",\"active_high\":true,\"chip\":\"b\",\"chip_line\":\"c\",\"wall_us\":7}",
        "{\"active_high\":true,\"chip\":\"b\",\"chip_line\":\"c\",\"wall_us\":7}",
        "{\"line\":\"a\",\"chip\":\"b\",\"chip_line\":\"c\",\"wall_us\":7}",
        "{\"line\":\"a\",\"active_high\":1,\"chip\":\"b\",\"chip_line\":\"c\",\"wall_us\":7}",
        "{\"line\":\"a\",\"active_high\":true,\"chip_line\":\"c\",\"wall_us\":7}",
        "{\"line\":\"a\",\"active_high\":true,\"chip\":\"b\",\"wall_us\":7}",
        "{\"line\":\"a\",\"active_high\":true,\"chip\":\"b\",\"chip_line\":\"c\"}",
        "{\"line\":\"a\",\"active_high\":true,\"chip\":\"b\",\"chip_line\":\"c\",\"wall_us\":0}",
        "{\"line\":\"a\",\"active_high\":true,\"chip\":\"b\",\"chip_line\":\"c\",\"wall_us\":7.5}",
        "{\"line\":\"a\",\"active_high\":true,\"chip\":\"b\",\"chip_line\":\"c\",\"line2\":\"d\",\"wall_us\":7}",
    };
    for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
        iwn_work_t work;
        char why[128];
        iwn_text_t reason = iwn_text_begin(why, sizeof why);
        iwn_json_t root;
        gw_tried_t got;
        TEST_ASSERT_TRUE(iwn_json_check(members[i], strlen(members[i]), &work, &root, &reason));
        TEST_ASSERT_EQUAL_MESSAGE(i == 0U, gw_tried_read(root, &got), members[i]);
    }
}
