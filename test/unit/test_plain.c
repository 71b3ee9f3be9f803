// SPDX-License-Identifier: MIT
// Characters that control a terminal are refused at input, and never printed raw.

#include "iwheel_northbound/text.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>

/// The first and the last code point of each range that controls a terminal, with their plain neighbours.
static const struct {
    uint32_t code_point;
    bool plain;
} table[] = {
    {0x00, false},   {0x01, false},   {0x07, false},   {0x09, false},   {0x0A, false},    {0x1B, false},
    {0x1F, false},   {0x20, true},    {0x7E, true},    {0x7F, false},   {0x80, false},    {0x85, false},
    {0x9B, false},   {0x9F, false},   {0xA0, true},    {0xAD, true},    {0xE9, true},     {0x61B, true},
    {0x61C, false},  {0x61D, true},   {0x200D, true},  {0x200E, false}, {0x200F, false},  {0x2010, true},
    {0x2027, true},  {0x2028, false}, {0x2029, false}, {0x202A, false}, {0x202B, false},  {0x202C, false},
    {0x202D, false}, {0x202E, false}, {0x202F, true},  {0x2065, true},  {0x2066, false},  {0x2067, false},
    {0x2068, false}, {0x2069, false}, {0x206A, true},  {0x20AC, true},  {0xD7FF, true},   {0xE000, true},
    {0xFFFD, true},  {0xFFFF, true},  {0x10000, true}, {0x1F6D1, true}, {0x10FFFF, true},
};
#define ROWS (sizeof table / sizeof table[0])

/// Encodes as UTF-8 and appends a zero byte.
static size_t encode(uint32_t code_point, char out[5]) {
    size_t length = 0;
    if (code_point < 0x80U) {
        out[length++] = (char)code_point;
    } else if (code_point < 0x800U) {
        out[length++] = (char)(0xC0U | code_point >> 6);
    } else if (code_point < 0x10000U) {
        out[length++] = (char)(0xE0U | code_point >> 12);
        out[length++] = (char)(0x80U | (code_point >> 6 & 0x3FU));
    } else {
        out[length++] = (char)(0xF0U | code_point >> 18);
        out[length++] = (char)(0x80U | (code_point >> 12 & 0x3FU));
        out[length++] = (char)(0x80U | (code_point >> 6 & 0x3FU));
    }
    if (code_point >= 0x80U) {
        out[length++] = (char)(0x80U | (code_point & 0x3FU));
    }
    out[length] = '\0';
    return length;
}

TEST(test_plain_each_code_point_at_the_edges_is_judged_and_read) {
    for (size_t i = 0; i < ROWS; i++) {
        char text[5];
        size_t bytes = 0;
        const size_t length = encode(table[i].code_point, text);
        TEST_ASSERT_EQUAL_HEX32(table[i].code_point, iwn_plain_read(text, &bytes));
        TEST_ASSERT_EQUAL_UINT(length, bytes);
        TEST_ASSERT_EQUAL_MESSAGE(table[i].plain, iwn_plain_is(table[i].code_point), "");
        TEST_ASSERT_EQUAL(table[i].plain || table[i].code_point == 0U, iwn_plain_text(text));
    }
}

TEST(test_plain_copy_replaces_each_character_once) {
    for (size_t i = 1; i < ROWS; i++) {
        char character[5];
        char text[16];
        char copy[16];
        char wanted[16];
        (void)encode(table[i].code_point, character);
        (void)snprintf(text, sizeof text, "a%sb", character);
        (void)snprintf(wanted, sizeof wanted, "a%sb", table[i].plain ? character : "?");
        iwn_plain_copy(text, copy, sizeof copy);
        TEST_ASSERT_EQUAL_STRING(wanted, copy);
    }
}

static const char *const broken[] = {
    "\x80",
    "\x9B",
    "\xC0\x80",
    "\xC1\xBF",
    "\xC2",
    "\xC2z",
    "\xE0\x80\x80",
    "\xE2\x80",
    "\xE2\x80z",
    "\xED\xA0\x80",
    "\xF0\x80\x80\x80",
    "\xF4\x90\x80\x80",
    "\xF5\x80\x80\x80",
    "\xFF",
    "\xFE",
};

TEST(test_plain_invalid_utf8_is_broken_byte_by_byte) {
    for (size_t i = 0; i < sizeof broken / sizeof broken[0]; i++) {
        size_t bytes = 0;
        char copy[16];
        TEST_ASSERT_EQUAL_HEX32(IWN_PLAIN_BROKEN, iwn_plain_read(broken[i], &bytes));
        TEST_ASSERT_EQUAL_UINT(1, bytes);
        TEST_ASSERT_FALSE(iwn_plain_text(broken[i]));
        iwn_plain_copy(broken[i], copy, sizeof copy);
        TEST_ASSERT_EQUAL_CHAR('?', copy[0]);
        TEST_ASSERT_TRUE(iwn_plain_text(copy));
    }
}

TEST(test_plain_copy_never_cuts_a_character) {
    char copy[8];
    iwn_plain_copy("12345\xE2\x82\xAC", copy, 8);
    TEST_ASSERT_EQUAL_STRING("12345", copy);
    iwn_plain_copy("1234\xE2\x82\xAC", copy, 8);
    TEST_ASSERT_EQUAL_STRING("1234\xE2\x82\xAC", copy);
    iwn_plain_copy("12345678", copy, 8);
    TEST_ASSERT_EQUAL_STRING("1234567", copy);
}

static void assert_json(const char *line, const char *wanted, size_t piece_size) {
    char whole[256] = "";
    char piece[64];
    size_t length = 0;
    while (*line != '\0') {
        line = iwn_plain_json(line, piece, piece_size, &length);
        TEST_ASSERT_GREATER_THAN_UINT(0, length);
        (void)strncat(whole, piece, length);
    }
    TEST_ASSERT_EQUAL_STRING(wanted, whole);
}

TEST(test_plain_json_escapes_terminal_controls_at_any_piece_size) {
    for (size_t size = 12; size <= 64; size++) {
        assert_json("{\"a\":\"b\xC2\x9B"
                    "2J\x7F\xE2\x80\xAE\xE2\x82\xAC\"}",
                    "{\"a\":\"b\\u009B2J\\u007F\\u202E\xE2\x82\xAC\"}", size);
        assert_json("{\r\"a\"\t:1}", "{ \"a\" :1}", size);
        assert_json("\xE2\x80\xA8\xE2\x80\xA9\xD8\x9C\xE2\x81\xA6\x9B", "\\u2028\\u2029\\u061C\\u2066\\uFFFD", size);
    }
}
