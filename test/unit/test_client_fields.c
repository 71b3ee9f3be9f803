// SPDX-License-Identifier: MIT
// libiwheel-client reads JSON: it accepts the same objects as jansson, and returns the fields of a message.
#include "iwheel_client/client.h"
#include "json.h"

#include "iwheel_northbound/json_in.h"

#include "unit.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WHEEL(more)                                                                                                    \
    "{\"heard\":true,\"at_rest\":false,\"speed_mm_s\":-210,\"applied_mm_s\":null,\"commanded_mm_s\":300," more         \
    "\"distance_mm\":5000000000,\"battery_dV\":243,\"temperature_degC\":-3,\"speed_age_ms\":3,\"force_age_ms\":29}"
static const char STATUS[] =
    "{\"id\":2,\"ok\":true,\"t_us\":99000000,\"state\":\"armed\",\"cause\":null,\"lease\":{\"holder\":7,\"name\":"
    "\"\\u001b[2J \\\"x\\\\\","
    "\"remaining_ms\":120},\"bus\":{\"state\":\"active\"},\"estop\":{\"state\":\"released\"},"
    "\"left\":" WHEEL("\"force_validity\":\"valid\",\"force_net_mN\":-120,") ",\"right\":" WHEEL(
        "\"force_validity\":\"saturated\",\"force_net_mN\":-99,") ",\"warnings\":[\"\xc3\xa4\",1.5e3,[],{}]}";

static iwc_t *gateway;

void setUp(void) {
    gateway = iwc_new();
}

void tearDown(void) {
    iwc_free(gateway);
}

static iwc_message_t message_of(const char *text) {
    return (iwc_message_t){.text = text, .length = strlen(text)};
}

static bool jansson_takes(const char *text, size_t length) {
    json_t *value = json_loadb(text, length, JSON_REJECT_DUPLICATES, NULL);
    const bool object = json_is_object(value);
    json_decref(value);
    return object;
}

static void compare(const char *text, size_t length) {
    if (iwc_json_is_object(text, length) != jansson_takes(text, length)) {
        char why[200];
        (void)snprintf(why, sizeof why, "%.*s", (length < 190) ? (int)length : 190, text);
        TEST_ASSERT_EQUAL_MESSAGE(jansson_takes(text, length), iwc_json_is_object(text, length), why);
    }
}

TEST(test_json_every_prefix_of_a_snapshot_agrees_with_jansson) {
    for (size_t length = 0; length < sizeof(STATUS); length++) {
        compare(STATUS, length);
    }
}

TEST(test_json_every_changed_byte_agrees_with_jansson) {
    static const char bytes[] = "\"\\{}[],:0-.eE+ x\x01\x7f\xc3\xa4\xed\xf5\nnu/";
    char text[sizeof(STATUS)];
    unsigned accepted = 0;
    for (size_t at = 0; at + 1U < sizeof(STATUS); at++) {
        for (size_t i = 0; i + 1U < sizeof bytes; i++) {
            memcpy(text, STATUS, sizeof(STATUS));
            text[at] = bytes[i];
            compare(text, sizeof(STATUS) - 1U);
            accepted += iwc_json_is_object(text, sizeof(STATUS) - 1U) ? 1U : 0U;
        }
    }
    TEST_ASSERT_GREATER_THAN(1000, accepted); // Both parsers also accept valid texts.
}

static bool is_trusted(const char *text, iwc_stored_t *stored) {
    return iwc_json_is_trusted_object(text, strlen(text), stored);
}

TEST(test_json_ledger_is_stored_until_it_changes) {
    static iwc_stored_t stored;
    stored.length = 0;
    TEST_ASSERT_TRUE(is_trusted("{\"event\":\"bus\",\"state\":\"active\"}", &stored));
    TEST_ASSERT_EQUAL_size_t(0, stored.length);
    TEST_ASSERT_EQUAL_size_t(0, stored.text_length);
    TEST_ASSERT_TRUE(is_trusted("{\"t_us\":1,\"ledger\":{\"a\":[1]},\"clients\":1}", &stored));
    TEST_ASSERT_EQUAL_STRING_LEN("{\"a\":[1]}", stored.value, stored.length);
    TEST_ASSERT_TRUE(is_trusted("{\"t_us\":22,\"ledger\":{\"a\":[1]},\"clients\":1}", &stored));
    TEST_ASSERT_FALSE(is_trusted("{\"t_us\":3,\"ledger\":{\"a\":[1]},\"clients\":}", &stored));
    TEST_ASSERT_FALSE(is_trusted("{\"t_us\":3,\"ledger\":{\"a\":[2},\"clients\":1}", &stored));
    TEST_ASSERT_EQUAL_size_t(strlen("{\"a\":[1]}"), stored.length);
    TEST_ASSERT_TRUE(is_trusted("{\"t_us\":4,\"ledger\":{\"a\":[\"x\"]},\"clients\":1}", &stored));
    TEST_ASSERT_EQUAL_STRING_LEN("{\"a\":[\"x\"]}", stored.value, stored.length);
    TEST_ASSERT_TRUE(is_trusted("{\"t_us\":5,\"ledger\":null}", &stored));
    TEST_ASSERT_EQUAL_STRING_LEN("{\"a\":[\"x\"]}", stored.value, stored.length);
}

TEST(test_json_ledger_beyond_its_buffer_is_not_stored) {
    static iwc_stored_t stored;
    static char text[IWC_STORED_MAX + 64U];
    for (size_t more = 0; more < 2U; more++) {
        stored.length = 0;
        const int blanks = (int)(IWC_STORED_MAX - strlen("{}") + more);
        const int length = snprintf(text, sizeof text, "{\"ledger\":{%*s}}", blanks, "");
        TEST_ASSERT_TRUE(iwc_json_is_trusted_object(text, (size_t)length, &stored));
        TEST_ASSERT_EQUAL_size_t((more == 0U) ? IWC_STORED_MAX : 0U, stored.length);
    }
}

/// The stored text is no JSON, so only a text that is not checked again is accepted.
TEST(test_json_text_with_other_integers_is_not_checked) {
    static const char checked[] = "{\"a\":[1,-22,0],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}";
    static const char *const accepted[] = {"{\"a\":[1,-22,0],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                           "{\"a\":[1,22,0],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                           "{\"a\":[-1,-2,-0],\"b c\":{\"d\":70},\"s\":\"x,-66,y\",#}",
                                           "{\"a\":[123456789012345678,0,9],\"b c\":{\"d\":0},\"s\":\"x,5,y\",#}"};
    static const char *const refused[] = {"{\"a\":[1,-22,00],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,-22,-],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,-22,0.5],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,-22,0e],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,-22,],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,--2,0],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,2-2,0],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,-22,0],\"b 1\":{\"d\":7},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,-22,0],\"b c\":{\"d\":true},\"s\":\"x,5,y\",#}",
                                          "{\"a\":[1,-22,0],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#",
                                          "{\"a\":[1,-22,0],\"b c\":{\"d\":7",
                                          "{\"a\":[1,-22,0],\"b c\":{\"d\":7},\"s\":\"x,5,y\",#}}",
                                          "{\"a\":[1234567890123456789,0,9],\"b c\":{\"d\":0},\"s\":\"x,5,y\",#}"};
    static iwc_stored_t stored;
    memset(&stored, 0, sizeof stored);
    TEST_ASSERT_FALSE(is_trusted(checked, &stored));
    stored.text_length = strlen(checked);
    memcpy(stored.text, checked, sizeof checked);
    for (size_t i = 0; i < sizeof accepted / sizeof accepted[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(is_trusted(accepted[i], &stored), accepted[i]);
    }
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(is_trusted(refused[i], &stored), refused[i]);
    }
}

TEST(test_json_text_with_other_reals_is_checked) {
    static const char checked[] = "{\"ledger\":{},\"a\":[1e308,1.5]}";
    static const char *const refused[] = {"{\"ledger\":{},\"a\":[9e308,1.5]}", "{\"ledger\":{},\"a\":[1e308,1.-5]}"};
    static iwc_stored_t stored;
    memset(&stored, 0, sizeof stored);
    TEST_ASSERT_TRUE(is_trusted(checked, &stored));
    TEST_ASSERT_EQUAL_size_t(strlen(checked), stored.text_length);
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(is_trusted(refused[i], &stored), refused[i]);
    }
}

static iwc_stored_t of_status; ///< With the text STATUS; it does not change.
static unsigned of_status_accepted;

static void compare_with_stored(const char *text, size_t length) {
    static iwc_stored_t after;
    static iwc_stored_t empty;
    char *const copy = malloc(length + 1U); // A sanitizer finds a read beyond it.
    memcpy(copy, text, length);
    after.text_length = of_status.text_length;
    memcpy(after.text, of_status.text, of_status.text_length);
    empty.text_length = 0;
    const bool good = iwc_json_is_trusted_object(copy, length, &empty);
    of_status_accepted += good ? 1U : 0U;
    TEST_ASSERT_EQUAL_MESSAGE(good, iwc_json_is_trusted_object(copy, length, &after), text);
    free(copy);
}

TEST(test_json_stored_text_changes_no_verdict) {
    static const char bytes[] = "\"\\{}[],:0-.eE+ x\x01\xc3\xa4nu/123456789";
    char text[sizeof(STATUS) + 1U];
    of_status.text_length = sizeof(STATUS) - 1U;
    memcpy(of_status.text, STATUS, sizeof(STATUS));
    for (size_t at = 0; at + 1U < sizeof(STATUS); at++) {
        for (size_t i = 0; i + 1U < sizeof bytes; i++) {
            memcpy(text, STATUS, sizeof(STATUS));
            text[at] = bytes[i];
            compare_with_stored(text, sizeof(STATUS) - 1U); // One byte changed.
            memcpy(text + at + 1U, STATUS + at, sizeof(STATUS) - at);
            compare_with_stored(text, sizeof(STATUS)); // One byte more.
        }
        memcpy(text + at, STATUS + at + 1U, sizeof(STATUS) - at - 1U);
        compare_with_stored(text, sizeof(STATUS) - 2U); // One byte less.
    }
    TEST_ASSERT_GREATER_THAN(1000, of_status_accepted);
}

TEST(test_json_text_beyond_its_buffer_is_not_stored) {
    static iwc_stored_t stored;
    static char text[IWC_STORED_MAX + 64U];
    for (size_t more = 0; more < 2U; more++) {
        stored.text_length = 0;
        const int blanks = (int)(IWC_STORED_MAX - strlen("{\"ledger\":{}}") + more);
        const int length = snprintf(text, sizeof text, "{%*s\"ledger\":{}}", blanks, "");
        TEST_ASSERT_TRUE(iwc_json_is_trusted_object(text, (size_t)length, &stored));
        TEST_ASSERT_EQUAL_size_t((more == 0U) ? IWC_STORED_MAX : 0U, stored.text_length);
        TEST_ASSERT_TRUE(iwc_json_is_trusted_object(text, (size_t)length, &stored));
    }
}

TEST(test_json_hard_cases_agree_with_jansson) {
    static const char *const texts[] = {"{}",
                                        " {} ",
                                        "{ }",
                                        "[]",
                                        "1",
                                        "",
                                        " ",
                                        "{\"a\":1,}",
                                        "{,}",
                                        "{\"a\"}",
                                        "{\"a\":}",
                                        "{\"a\":01}",
                                        "{\"a\":-}",
                                        "{\"a\":-0}",
                                        "{\"a\":1.}",
                                        "{\"a\":.5}",
                                        "{\"a\":1e}",
                                        "{\"a\":1e+5}",
                                        "{\"a\":1E-5}",
                                        "{\"a\":9223372036854775808}",
                                        "{\"a\":-9223372036854775809}",
                                        "{\"a\":1e400}",
                                        "{\"a\":+1}",
                                        "{\"a\":NaN}",
                                        "{\"a\":tru}",
                                        "{\"a\":truex}",
                                        "{\"a\":[1,]}",
                                        "{\"a\":[,]}",
                                        "{\"a\":[1 2]}",
                                        "{\"a\":\"\\x\"}",
                                        "{\"a\":\"\\u12\"}",
                                        "{\"a\":\"\\u12g4\"}",
                                        "{\"a\":\"\t\"}",
                                        "{\"a\":\"\xc0\x80\"}",
                                        "{\"a\":\"\xe0\x9f\xbf\"}",
                                        "{\"a\":\"\xed\xa0\x80\"}",
                                        "{\"a\":\"\xf4\x90\x80\x80\"}",
                                        "{\"a\":\"\xf0\x8f\xbf\xbf\"}",
                                        "{\"a\":\"\xf0\x9f\x9a\xb6\"}",
                                        "{\"a\":\"\xe2\x82\"}",
                                        "{\"a\":1,\"a\":2}",
                                        "{\"a\":{\"b\":1},\"b\":{\"b\":1}}",
                                        "{\"a\":[{\"b\":1,\"b\":1}]}",
                                        "{}{}",
                                        "{} x",
                                        "{'a':1}",
                                        "{\"a\":1 \"b\":2}",
                                        "{\"a\" : 1 , \"b\" : [ ] }",
                                        "\xef\xbb\xbf{}"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        compare(texts[i], strlen(texts[i]));
    }
}

TEST(test_json_nul_byte_is_refused_at_every_position) {
    char text[sizeof(STATUS)];
    for (size_t at = 0; at < sizeof(STATUS); at++) {
        memcpy(text, STATUS, sizeof(STATUS));
        text[at] = '\0';
        TEST_ASSERT_FALSE(iwc_json_is_object(text, sizeof(STATUS) - ((at + 1U < sizeof(STATUS)) ? 1U : 0U)));
    }
}

TEST(test_json_depth_is_bounded) {
    char text[200] = "{\"a\":";
    const char *const inner = text + 5;
    for (unsigned depth = 1; depth < 40; depth++) {
        memset(text + 5, '[', depth);
        memset(text + 5 + depth, ']', depth);
        text[5 + 2U * depth] = '}';
        TEST_ASSERT_EQUAL(depth < IWN_DEPTH_MAX, iwc_json_is_object(text, 6U + 2U * depth));
    }
    TEST_ASSERT_EQUAL_CHAR('[', *inner);
}

TEST(test_json_duplicate_of_the_first_of_many_keys_is_refused) {
    static char text[IWC_LINE_MAX];
    size_t used = (size_t)snprintf(text, sizeof text, "{\"a\":1");
    for (unsigned i = 0; used < sizeof text - 30U; i++) {
        used += (size_t)snprintf(text + used, sizeof text - used, ",\"%x\":0", i + 0x10U);
    }
    used += (size_t)snprintf(text + used, sizeof text - used, ",\"a\":2}");
    TEST_ASSERT_FALSE(iwc_json_is_object(text, used)); // The first keys are stored until the end.
}

TEST(test_field_integers_must_be_whole_and_fit_64_bits) {
    const iwc_message_t message =
        message_of("{\"a\":9223372036854775807,\"b\":-9223372036854775808,\"d\":1.0,\"e\":null,\"f\":true,\"g\":\"1\","
                   "\"h\":1e2,\"i\":{\"a\":5},\"k\":-0}");
    static const char *const unknown[] = {"d", "e", "f", "g", "h", "i", "x", "i.b", "a.b", "i.a.b", ""};
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, iwc_integer(&message, "a").value);
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, iwc_integer(&message, "b").value);
    TEST_ASSERT_EQUAL_INT64(5, iwc_integer(&message, "i.a").value);
    TEST_ASSERT_TRUE(iwc_integer(&message, "k").known);
    TEST_ASSERT_EQUAL_INT64(1, iwc_truth(&message, "f").value);
    TEST_ASSERT_FALSE(iwc_truth(&message, "e").known);
    for (size_t i = 0; i < sizeof unknown / sizeof unknown[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(iwc_integer(&message, unknown[i]).known, unknown[i]);
        TEST_ASSERT_EQUAL_INT64(0, iwc_integer(&message, unknown[i]).value);
    }
}

TEST(test_field_name_that_begins_alike_is_another) {
    const iwc_message_t message = message_of("{\"speeds\":1,\"speed\":2,\"spee\":3}");
    TEST_ASSERT_EQUAL_INT64(2, iwc_integer(&message, "speed").value);
    TEST_ASSERT_EQUAL_INT64(3, iwc_integer(&message, "spee").value);
    TEST_ASSERT_FALSE(iwc_integer(&message, "sp").known);
}

TEST(test_field_cursor_finds_fields_in_any_order) {
    const iwc_message_t message = message_of("{\"a\":1,\"o\":{\"b\":2,\"c\":\"x\",\"b.d\":3},\"e\":true,\"a\":9}");
    iwc_cursor_t cursor = {&message, NULL};
    char text[8];
    const iwc_message_t object = iwc_field(&cursor, "o");
    TEST_ASSERT_EQUAL_INT64(2, iwc_integer(&object, "b").value);
    TEST_ASSERT_TRUE(iwc_is(&object, "c", "x"));
    const iwc_message_t last = iwc_field(&cursor, "e");
    TEST_ASSERT_EQUAL_INT64(1, iwc_truth(&last, "").value);
    const iwc_message_t behind = iwc_field(&cursor, "a");
    TEST_ASSERT_EQUAL_INT64(9, iwc_integer(&behind, "").value);
    const iwc_message_t none = iwc_field(&cursor, "x");
    TEST_ASSERT_NULL(none.text);
    TEST_ASSERT_FALSE(iwc_integer(&none, "").known || iwc_truth(&none, "").known || iwc_integer(&none, "a").known);
    TEST_ASSERT_FALSE(iwc_text(&none, "", text, sizeof text) || iwc_is(&none, "", "") || iwc_is(&none, "a", "x"));
    const iwc_message_t first = iwc_field(&cursor, "a");
    TEST_ASSERT_EQUAL_INT64(1, iwc_integer(&first, "").value);
    iwc_cursor_t inside = {&object, NULL};
    const iwc_message_t name = iwc_field(&inside, "c");
    TEST_ASSERT_TRUE(iwc_text(&name, "", text, sizeof text));
    TEST_ASSERT_EQUAL_STRING("x", text);
    const iwc_message_t dotted = iwc_field(&inside, "b.d");
    TEST_ASSERT_EQUAL_INT64(3, iwc_integer(&dotted, "").value);
    inside = (iwc_cursor_t){&name, NULL};
    TEST_ASSERT_NULL(iwc_field(&inside, "c").text);
}

TEST(test_field_text_is_escaped_and_cut_between_characters) {
    const iwc_message_t message = message_of(STATUS);
    const iwc_message_t umlauts = message_of("{\"a\":\"\xc3\xa4\xc3\xa4\\u001b\"}");
    char text[20];
    TEST_ASSERT_TRUE(iwc_text(&message, "lease.name", text, sizeof text));
    TEST_ASSERT_EQUAL_STRING("\\u001b[2J \"x\\", text);
    TEST_ASSERT_TRUE(iwc_text(&umlauts, "a", text, 4));
    TEST_ASSERT_EQUAL_STRING("\xc3\xa4", text);
    TEST_ASSERT_TRUE(iwc_text(&umlauts, "a", text, 10));
    TEST_ASSERT_EQUAL_STRING("\xc3\xa4\xc3\xa4", text);
    TEST_ASSERT_FALSE(iwc_text(&message, "cause", text, sizeof text));
    TEST_ASSERT_EQUAL_STRING("", text);
    TEST_ASSERT_TRUE(iwc_is(&message, "state", "armed"));
    TEST_ASSERT_FALSE(iwc_is(&message, "state", "arme"));
    TEST_ASSERT_FALSE(iwc_is(&message, "t_us", "99000000"));
}

TEST(test_field_json_is_the_text_of_the_member) {
    size_t length = 0;
    const iwc_message_t message = message_of(STATUS);
    const char *bus = iwc_json(&message, "bus", &length);
    TEST_ASSERT_EQUAL_STRING_LEN("{\"state\":\"active\"}", bus, length);
    TEST_ASSERT_EQUAL_size_t(18, length);
    TEST_ASSERT_NULL(iwc_json(&message, "nothing", &length));
    TEST_ASSERT_EQUAL_size_t(0, length);
}

TEST(test_state_of_a_snapshot_null_is_unknown) {
    const iwc_message_t message = message_of(STATUS);
    iwc_state_t state;
    TEST_ASSERT_TRUE(iwc_state(gateway, &message, &state));
    TEST_ASSERT_EQUAL_INT64(99000000, state.t_us);
    TEST_ASSERT_EQUAL(IWC_ARMED, state.machine);
    TEST_ASSERT_EQUAL_STRING("", state.cause);
    TEST_ASSERT_EQUAL_INT64(7, state.holder.value);
    TEST_ASSERT_FALSE(state.ours); // Without a connection no lease is ours.
    TEST_ASSERT_EQUAL_INT64(120, state.remaining_ms.value);
    TEST_ASSERT_TRUE(state.estop_released && state.bus_active && state.left.heard && state.right.heard);
    TEST_ASSERT_TRUE(state.left.at_rest.known);
    TEST_ASSERT_EQUAL_INT64(0, state.left.at_rest.value);
    TEST_ASSERT_EQUAL_INT64(-210, state.left.speed_mm_s.value);
    TEST_ASSERT_EQUAL_INT64(300, state.left.commanded_mm_s.value);
    TEST_ASSERT_FALSE(state.left.applied_mm_s.known);
    TEST_ASSERT_EQUAL_INT64(5000000000, state.left.distance_mm.value);
    TEST_ASSERT_EQUAL_INT64(243, state.left.battery_dV.value);
    TEST_ASSERT_EQUAL_INT64(-3, state.left.temperature_degC.value);
    TEST_ASSERT_EQUAL_INT64(3, state.left.speed_age_ms.value);
    TEST_ASSERT_EQUAL_INT64(29, state.left.force_age_ms.value);
    TEST_ASSERT_TRUE(state.left.force_net_mN.known);
    TEST_ASSERT_EQUAL_INT64(-120, state.left.force_net_mN.value);
    TEST_ASSERT_FALSE(state.right.force_net_mN.known); // The force is saturated: its value is not valid.
    TEST_ASSERT_EQUAL_INT64(0, state.right.force_net_mN.value);
}

TEST(test_state_in_another_order_is_read) {
    const iwc_message_t message = message_of(
        " {\"right\":{\"force_age_ms\":5,\"force_validity\":\"valid\",\"force_net_mN\":8,\"speed_mm_s\":-2,\"heard\":"
        "true},"
        "\"left\":{\"other\":{\"heard\":true},\"at_rest\":true},\"estop\":{\"line\":\"state\",\"state\":\"released\"},"
        "\"lease\":{\"remaining_ms\":4,\"holder\":9},\"cause\":\"estop\",\"state\":\"latched\",\"t_us\":6}");
    iwc_state_t state;
    TEST_ASSERT_TRUE(iwc_state(gateway, &message, &state));
    TEST_ASSERT_EQUAL_INT64(6, state.t_us);
    TEST_ASSERT_EQUAL(IWC_LATCHED, state.machine);
    TEST_ASSERT_EQUAL_STRING("estop", state.cause);
    TEST_ASSERT_EQUAL_INT64(9, state.holder.value);
    TEST_ASSERT_EQUAL_INT64(4, state.remaining_ms.value);
    TEST_ASSERT_TRUE(state.estop_released);
    TEST_ASSERT_FALSE(state.bus_active || state.left.heard || state.left.speed_mm_s.known);
    TEST_ASSERT_EQUAL_INT64(1, state.left.at_rest.value);
    TEST_ASSERT_TRUE(state.right.heard);
    TEST_ASSERT_EQUAL_INT64(-2, state.right.speed_mm_s.value);
    TEST_ASSERT_EQUAL_INT64(8, state.right.force_net_mN.value);
    TEST_ASSERT_EQUAL_INT64(5, state.right.force_age_ms.value);
}

TEST(test_state_of_another_message_is_unchanged) {
    static const char *const texts[] = {"{\"id\":1,\"ok\":true,\"state\":\"armed\"}",
                                        "{\"event\":\"bus\",\"state\":\"down\"}"};
    iwc_state_t state = {.t_us = 42};
    for (size_t i = 0; i < 2; i++) {
        const iwc_message_t message = message_of(texts[i]);
        TEST_ASSERT_FALSE(iwc_state(gateway, &message, &state));
        TEST_ASSERT_EQUAL_INT64(42, state.t_us);
    }
}
