// SPDX-License-Identifier: MIT
// The JSON reader in place: valid and invalid JSON, and the walk through valid JSON.
#include "iwheel_northbound/json_in.h"
#include "unit.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static iwn_work_t work;
static iwn_json_t root;
static char why[200];

void setUp(void) {
    memset(&work, 0xA5, sizeof work);
    why[0] = '\0';
}

/// Checks a copy of exactly that length, so that sanitizers detect a read after the last byte.
static bool check(const char *text, size_t length) {
    static char *copy;
    iwn_text_t fault = iwn_text_begin(why, sizeof why);
    free(copy);
    copy = malloc((length > 0U) ? length : 1U);
    memcpy(copy, text, length);
    const bool good = iwn_json_check(copy, length, &work, &root, &fault);
    TEST_ASSERT_EQUAL_MESSAGE(good, why[0] == '\0', text);
    return good;
}

static void refused(const char *text, const char *because) {
    TEST_ASSERT_FALSE_MESSAGE(check(text, strlen(text)), text);
    TEST_ASSERT_EQUAL_STRING(because, why);
}

static iwn_json_t member(const char *name) {
    iwn_json_t value;
    TEST_ASSERT_TRUE_MESSAGE(iwn_json_find(root, name, &value), name);
    return value;
}

#define YES(name, text)     TEST_ASSERT_TRUE_MESSAGE(check(text, sizeof text - 1U), name);
#define NO(name, text)      TEST_ASSERT_FALSE_MESSAGE(check(text, sizeof text - 1U), name);
#define OWN_YES(name, text) YES(name, text)
#define OWN_NO(name, text)  NO(name, text)

TEST(test_json_every_vector_is_read_or_refused_as_in_the_table){
#include "json_vectors.inc"
}

TEST(test_json_cut_anywhere_is_refused) {
    const char *text = "{\"a\":[1,-2.5e3,\"\\u20ac\\\"\"],\"b\":{\"c\":null},\"d\":true}";
    for (size_t length = 0; length < strlen(text); length++) {
        TEST_ASSERT_FALSE(check(text, length));
    }
    TEST_ASSERT_TRUE(check(text, strlen(text)));
}

TEST(test_json_nul_byte_anywhere_is_refused) {
    const char *text = "{\"a\":[1,-2.5e3,\"x\"],\"b\":true}";
    const size_t length = strlen(text);
    char spoilt[64];
    for (size_t at = 0; at <= length; at++) {
        memcpy(spoilt, text, at);
        spoilt[at] = '\0';
        memcpy(&spoilt[at + 1U], &text[at], length - at);
        TEST_ASSERT_FALSE(check(spoilt, length + 1U));
    }
}

TEST(test_json_duplicate_or_too_many_names_are_refused) {
    static char text[16384];
    size_t length = (size_t)snprintf(text, sizeof text, "{\"z\":0");
    for (unsigned i = 0; i < IWN_NAMES_MAX - 1U; i++) {
        length += (size_t)snprintf(&text[length], sizeof text - length, ",\"%x\":%u", (i * 7919U) % 1021U, i);
    }
    text[length] = '}';
    TEST_ASSERT_TRUE_MESSAGE(check(text, length + 1U), why);
    (void)snprintf(&text[length], sizeof text - length, ",\"%x\":1}", (500U * 7919U) % 1021U);
    refused(text, "duplicate object key near '\"3e\"'");
    (void)snprintf(&text[length], sizeof text - length, ",\"y\":1}");
    refused(text, "too many names near '\"y\"'");
}

TEST(test_json_longer_than_the_limit_is_refused) {
    static char text[IWN_JSON_MAX + 1U];
    memset(text, ' ', sizeof text);
    memcpy(text, "[]", 2);
    TEST_ASSERT_TRUE(check(text, IWN_JSON_MAX));
    TEST_ASSERT_FALSE(check(text, IWN_JSON_MAX + 1U));
}

TEST(test_json_refusal_names_the_fault_and_its_place) {
    refused("", "'[' or '{' expected near end of file");
    refused("x", "'[' or '{' expected near 'x'");
    refused("{\"a\":1,}", "string or '}' expected near '}'");
    refused("{\"a\" 1}", "':' expected near '1'");
    refused("{\"a\":1 2}", "'}' expected near '2'");
    refused("[1 2]", "']' expected near '2'");
    refused("[1,", "']' expected near end of file");
    refused("{\"a\":", "unexpected token near end of file");
    refused("[01]", "invalid token near '0'");
    refused("[1.]", "invalid token near '1.'");
    refused("[1e+]", "invalid token near '1e+'");
    refused("[] []", "end of file expected near '['");
    refused("[\"a", "premature end of input near '\"a'");
    refused("[\"a\x01\"]", "control character 0x1 near '\"a'");
    refused("[\"\x1F\"]", "control character 0x1f near '\"'");
    refused("[\"\\x\"]", "invalid escape near '\"\\x'");
    refused("[\"\\u12G\"]", "invalid escape near '\"\\u12G'");
    refused("[\"\\ud800\"]", "invalid Unicode '\\uD800' near '\"\\ud800\"'");
    refused("[\"\\ud800\\u0041\"]", "invalid Unicode '\\uD800\\u0041' near '\"\\ud800\\u0041\"'");
    refused("{\"\\u0000\":1}", "NUL byte in object key not supported near '\"\\u0000\"'");
    refused("[9223372036854775808]", "too big integer near '9223372036854775808'");
    refused("[-9223372036854775809]", "too big negative integer near '-9223372036854775809'");
    refused("[1e309]", "real number overflow near '1e309'");
    refused("\xFF", "unable to decode byte 0xff");
    refused("[1\xC3]", "unable to decode byte 0xc3 near '1'");
    refused("[\xC3\xA9]", "unreadable");
    refused("[truetruetruetruetrue]", "invalid token near 'truetruetruetruetrue'");
    refused("[truetruetruetruetruet]", "invalid token");
}

TEST(test_json_character_cut_by_the_end_is_refused) {
    static const char text[] = "[\"\xC3\xA9\"]";
    iwn_text_t fault = iwn_text_begin(why, sizeof why);
    TEST_ASSERT_FALSE(iwn_json_check(text, 3U, &work, &root, &fault));
    TEST_ASSERT_EQUAL_STRING("unable to decode byte 0xc3 near '\"'", why);
}

TEST(test_json_walk_returns_members_and_values_in_order) {
    const char *text = " { \"a\" : [ 1 , \"]\" , { } ] , \"b\" : { \"c\\\"\" : null } , \"d\" : -5 } ";
    static const char *const names[] = {"a", "b", "d"};
    iwn_json_t name;
    iwn_json_t value;
    TEST_ASSERT_TRUE(check(text, strlen(text)));
    iwn_json_t rest = iwn_json_inside(root);
    for (size_t i = 0; i < 3U; i++) {
        TEST_ASSERT_TRUE(iwn_json_next(&rest, &name, &value));
        TEST_ASSERT_TRUE(iwn_json_is(name, names[i]));
    }
    TEST_ASSERT_FALSE(iwn_json_next(&rest, &name, &value));
    rest = iwn_json_inside(member("a"));
    static const iwn_json_kind_t kinds[] = {IWN_JSON_INTEGER, IWN_JSON_TEXT, IWN_JSON_OBJECT};
    for (size_t i = 0; i < 3U; i++) {
        TEST_ASSERT_TRUE(iwn_json_next(&rest, NULL, &value));
        TEST_ASSERT_EQUAL_INT(kinds[i], iwn_json_kind(value));
    }
    TEST_ASSERT_FALSE(iwn_json_next(&rest, NULL, &value));
    TEST_ASSERT_TRUE(iwn_json_find(member("b"), "c\"", &value));
    TEST_ASSERT_FALSE(iwn_json_find(member("b"), "c", &value));
    TEST_ASSERT_FALSE(iwn_json_find(member("d"), "c", &value));
}

TEST(test_json_without_work_may_have_a_name_twice) {
    static const char *const texts[] = {"{\"a\":1,\"a\":2}", "{\"a\":{\"b\":1,\"b\":1}}"};
    const char *text = "{\"a\":[1,-2.5e3,\"\\u20ac\\\"\"],\"b\":{\"c\":null},\"d\":true}";
    iwn_text_t fault = iwn_text_begin(why, sizeof why);
    for (size_t length = 0; length < strlen(text); length++) {
        TEST_ASSERT_FALSE(iwn_json_check(text, length, NULL, &root, &fault));
    }
    TEST_ASSERT_TRUE(iwn_json_check(text, strlen(text), NULL, &root, &fault));
    for (size_t i = 0; i < 2U; i++) {
        TEST_ASSERT_TRUE(iwn_json_check(texts[i], strlen(texts[i]), NULL, &root, &fault));
        TEST_ASSERT_FALSE(check(texts[i], strlen(texts[i])));
    }
}

static bool check_again(const char *text, size_t length, iwn_repeated_t *repeated) {
    iwn_text_t fault = iwn_text_begin(why, sizeof why);
    char *const copy = malloc(length + 1U); // A sanitizer finds a read beyond it.
    memcpy(copy, text, length);
    const bool good = iwn_json_check_again(copy, length, repeated, &root, &fault);
    free(copy);
    return good;
}

/// The stored value is no JSON, so only a text in which it is not checked is accepted.
TEST(test_json_repeated_value_of_the_root_is_not_checked) {
    static const char *const accepted[] = {"{\"a\":{#}}", "{\"b\":[1],\"a\":{#},\"c\":{}}", "{\"a\":{#} , \"b\":{#}}"};
    static const char *const refused_texts[] = {"{\"b\":{\"a\":{#}}}", "[{#}]",         "{\"a\":[{#}]}", "{\"a\":{#}",
                                                "{\"a\":{#",           "{\"a\":{#}1}",  "{\"a\":{!}}",   "{{#}:1}",
                                                "{\"a\":{#},}",        "{\"a\":{#}}\"x"};
    iwn_repeated_t repeated = {.value = "{#}", .length = 3U};
    for (size_t i = 0; i < sizeof accepted / sizeof accepted[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(check_again(accepted[i], strlen(accepted[i]), &repeated), accepted[i]);
        TEST_ASSERT_TRUE(repeated.met);
    }
    for (size_t i = 0; i < sizeof refused_texts / sizeof refused_texts[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(check_again(refused_texts[i], strlen(refused_texts[i]), &repeated), refused_texts[i]);
    }
    for (size_t length = 0; length < strlen(accepted[0]); length++) { // The bytes behind the end would match.
        iwn_text_t fault = iwn_text_begin(why, sizeof why);
        TEST_ASSERT_FALSE(iwn_json_check_again(accepted[0], length, &repeated, &root, &fault));
        TEST_ASSERT_EQUAL(length == strlen("{\"a\":{#}"), repeated.met);
    }
    TEST_ASSERT_TRUE(check_again("{\"a\":1}", 7U, &repeated));
    TEST_ASSERT_FALSE(repeated.met);
    repeated.length = 0;
    TEST_ASSERT_TRUE(check_again("{\"a\":{}}", 8U, &repeated));
    TEST_ASSERT_FALSE(repeated.met);
    TEST_ASSERT_FALSE(check_again(accepted[0], strlen(accepted[0]), &repeated));
}

TEST(test_json_delete_is_allowed_in_a_text) {
    TEST_ASSERT_TRUE(check("[\"\x7f\x7f plain behind it \x7f\"]", 24U));
    TEST_ASSERT_TRUE(check("{\"\x7f\":1}", 7U));
    refused("[\x7f]", "unreadable");
}

TEST(test_json_names_of_the_root_are_found_in_their_order) {
    const char *text = " {\"d\":-5,\"b\" : {\"z\":1,\"a\":{}} ,\"\\u0061\":[{\"e\":1}],\"c\":\"x\"}";
    static const char *const names[] = {"a", "b", "c", "d"};
    static const iwn_json_kind_t kinds[] = {IWN_JSON_LIST, IWN_JSON_OBJECT, IWN_JSON_TEXT, IWN_JSON_INTEGER};
    TEST_ASSERT_TRUE(check(text, strlen(text)));
    TEST_ASSERT_EQUAL_PTR(root.at, iwn_json_root(root.at - 1).at);
    TEST_ASSERT_EQUAL_PTR(root.at, iwn_json_root(root.at).at);
    TEST_ASSERT_EQUAL_UINT16(4, work.names);
    for (unsigned i = 0; i < 4U; i++) {
        const iwn_json_t name = iwn_json_name(root.at - 1, &work, i);
        TEST_ASSERT_TRUE_MESSAGE(iwn_json_is(name, names[i]), names[i]);
        TEST_ASSERT_EQUAL_INT(kinds[i], iwn_json_kind(iwn_json_value(name)));
        TEST_ASSERT_EQUAL_PTR(member(names[i]).at, iwn_json_value(name).at);
    }
    TEST_ASSERT_TRUE(check("{}", 2U));
    TEST_ASSERT_EQUAL_UINT16(0, work.names);
    TEST_ASSERT_TRUE(check("[{\"a\":1}]", 9U));
    TEST_ASSERT_EQUAL_UINT16(0, work.names);
}

TEST(test_json_kinds_differ) {
    const char *text = "{\"t\":true,\"f\":false,\"n\":null,\"i\":-0,\"r\":0.0,\"e\":1E5,\"s\":\"\",\"o\":{},\"l\":[]}";
    TEST_ASSERT_TRUE(check(text, strlen(text)));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_TRUE, iwn_json_kind(member("t")));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_FALSE, iwn_json_kind(member("f")));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_NULL, iwn_json_kind(member("n")));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_INTEGER, iwn_json_kind(member("i")));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_REAL, iwn_json_kind(member("r")));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_REAL, iwn_json_kind(member("e")));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_TEXT, iwn_json_kind(member("s")));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_OBJECT, iwn_json_kind(member("o")));
    TEST_ASSERT_EQUAL_INT(IWN_JSON_LIST, iwn_json_kind(member("l")));
}

TEST(test_json_integers_at_the_limits_are_read_exactly) {
    const char *text = "{\"a\":9223372036854775807,\"b\":-9223372036854775808,\"c\":-0,\"d\":42}";
    TEST_ASSERT_TRUE(check(text, strlen(text)));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, iwn_json_integer(member("a")));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, iwn_json_integer(member("b")));
    TEST_ASSERT_EQUAL_INT64(0, iwn_json_integer(member("c")));
    TEST_ASSERT_EQUAL_INT64(42, iwn_json_integer(member("d")));
}

TEST(test_json_text_that_fits_is_unescaped) {
    const char *text =
        "{\"a\":\"\\\"\\\\\\/\\b\\f\\n\\r\\t\\u0041\\u00e9\\u20AC\\ud83d\\ude00\xC3\xA9\",\"b\":\"1234567\",\"c\":7}";
    char out[32];
    TEST_ASSERT_TRUE(check(text, strlen(text)));
    TEST_ASSERT_TRUE(iwn_json_text(member("a"), out, sizeof out));
    TEST_ASSERT_EQUAL_STRING("\"\\/\b\f\n\r\tA\xC3\xA9\xE2\x82\xAC\xF0\x9F\x98\x80\xC3\xA9", out);
    TEST_ASSERT_TRUE(iwn_json_is(member("a"), out));
    TEST_ASSERT_TRUE(iwn_json_text(member("b"), out, 8U));
    TEST_ASSERT_EQUAL_STRING("1234567", out);
    TEST_ASSERT_FALSE(iwn_json_text(member("b"), out, 7U));
    TEST_ASSERT_FALSE(iwn_json_text(member("c"), out, sizeof out));
    TEST_ASSERT_FALSE(iwn_json_is(member("c"), "7"));
    TEST_ASSERT_FALSE(iwn_json_is(member("b"), "123456"));
    TEST_ASSERT_FALSE(iwn_json_is(member("b"), "12345678"));
}
