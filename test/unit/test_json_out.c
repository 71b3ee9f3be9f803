// SPDX-License-Identifier: MIT
// The writer of replies and events writes the same bytes as a byte-by-byte writer, and never exceeds its buffer.
#include "iwheel_northbound/json_out.h"
#include "unit.h"

#include <inttypes.h>
#include <stdio.h>

static char line[512];
static iwn_out_t json;

void setUp(void) {
    memset(line, 0x5A, sizeof line);
    iwn_out_init(&json, line, sizeof line);
}

static void expect(const char *text) {
    TEST_ASSERT_FALSE(json.overflow);
    TEST_ASSERT_EQUAL_UINT(strlen(text), json.length);
    TEST_ASSERT_EQUAL_STRING_LEN(text, line, json.length);
}

TEST(test_json_control_characters_and_invalid_utf8_are_escaped) {
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "t", "\x1b[2J\xC2\x9B\xE2\x80\xAE\xE2\x80\xA8\xD8\x9C\xE2\x81\xA9\x9B\xE2\x82\xAC\xE2\x82");
    iwn_out_close(&json, '}');
    line[iwn_out_finish(&json)] = '\0';
    TEST_ASSERT_EQUAL_STRING(
        "{\"t\":\"\\u001B[2J\\u009B\\u202E\\u2028\\u061C\\u2069\\uFFFD\xE2\x82\xAC\\uFFFD\\uFFFD\"}\n", line);
}

TEST(test_json_members_are_escaped_and_separated) {
    iwn_out_open(&json, NULL, '{');
    iwn_out_int(&json, "low", INT64_MIN);
    iwn_out_text(&json, "t", "a\"b\\c\n\x7f\xE2\x82\xAC");
    iwn_out_open(&json, "list", '[');
    iwn_out_bool(&json, NULL, true);
    iwn_out_null(&json, NULL);
    iwn_out_close(&json, ']');
    iwn_out_open(&json, "empty", '{');
    iwn_out_close(&json, '}');
    iwn_out_known(&json, "k", false, 5);
    iwn_out_known(&json, "l", true, 5);
    iwn_out_text(&json, "n", NULL);
    iwn_out_close(&json, '}');
    const size_t length = iwn_out_finish(&json);
    line[length] = '\0';
    TEST_ASSERT_EQUAL_STRING(
        "{\"low\":-9223372036854775808,\"t\":\"a\\\"b\\\\c\\u000A\\u007F\xE2\x82\xAC\",\"list\":[true,null],"
        "\"empty\":{},\"k\":null,\"l\":5,\"n\":null}\n",
        line);
}

TEST(test_json_that_does_not_fit_is_not_written_at_any_size) {
    for (size_t size = 1; size <= 64U; size++) {
        memset(line, 0x5A, sizeof line);
        iwn_out_init(&json, line, size);
        iwn_out_open(&json, NULL, '{');
        iwn_out_text(&json, "event", "lost");
        iwn_out_close(&json, '}');
        const size_t whole = strlen("{\"event\":\"lost\"}\n");
        TEST_ASSERT_EQUAL_UINT((size > whole) ? whole : 0U, iwn_out_finish(&json));
        for (size_t i = size; i < sizeof line; i++) {
            TEST_ASSERT_EQUAL_HEX8(0x5A, line[i]);
        }
    }
}

TEST(test_json_number_is_written_like_printf) {
    int64_t number = 1;
    for (unsigned digits = 1; digits < 19U; digits++) {
        number *= 10;
        for (int64_t off = -101; off <= 101; off++) {
            char wanted[64];
            setUp();
            iwn_out_int(&json, "n", number + off);
            iwn_out_int(&json, NULL, -(number + off));
            (void)snprintf(wanted, sizeof wanted, "\"n\":%" PRId64 ",%" PRId64, number + off, -(number + off));
            expect(wanted);
        }
    }
    setUp();
    iwn_out_int(&json, NULL, INT64_MAX);
    iwn_out_int(&json, NULL, 4294967296);
    iwn_out_int(&json, NULL, 4000000000000000007);
    expect("9223372036854775807,4294967296,4000000000000000007");
}

/// Escapes bytes below 0x80 one by one, as the RFC and text.h specify.
static void write_slowly(const char *text, char *out) {
    out += sprintf(out, "\"t\":\"");
    for (; *text != '\0'; text++) {
        if (*text == '"' || *text == '\\') {
            out += sprintf(out, "\\%c", *text);
        } else if (*text < 0x20 || *text == 0x7F) {
            out += sprintf(out, "\\u%04X", (unsigned)*text);
        } else {
            out += sprintf(out, "%c", *text);
        }
    }
    (void)sprintf(out, "\"");
}

TEST(test_json_ascii_byte_anywhere_equals_the_reference_writer) {
    char text[32];
    char wanted[256];
    for (size_t length = 1; length < 20U; length++) {
        for (size_t at = 0; at < length; at++) {
            for (int byte = 1; byte < 0x80; byte++) {
                setUp();
                memset(text, 'x', length);
                text[length] = '\0';
                text[at] = (char)byte;
                iwn_out_text(&json, "t", text);
                write_slowly(text, wanted);
                expect(wanted);
            }
        }
    }
}

TEST(test_json_lone_byte_beyond_ascii_is_replaced_at_any_place) {
    char text[32];
    for (size_t at = 0; at < 18U; at++) {
        for (int byte = 0x80; byte < 0x100; byte++) {
            setUp();
            memset(text, 'x', 18);
            text[18] = '\0';
            text[at] = (char)byte;
            iwn_out_text(&json, NULL, text);
            TEST_ASSERT_EQUAL_UINT(2U + 17U + 6U, json.length);
            TEST_ASSERT_EQUAL_STRING_LEN("\\uFFFD", &line[1U + at], 6U);
        }
    }
}

TEST(test_json_text_beyond_ascii_is_unchanged) {
    iwn_out_text(&json, "t", "a\xC3\xA9\xE2\x82\xAC\xF0\x9F\x98\x80 12345678 \xC3\xA9");
    expect("\"t\":\"a\xC3\xA9\xE2\x82\xAC\xF0\x9F\x98\x80 12345678 \xC3\xA9\"");
}

/// Writes an object with an element of each kind. Returns the length of the line.
static size_t write_elements(void) {
    iwn_out_open(&json, NULL, '{');
    iwn_out_int(&json, "int", -1234567);
    iwn_out_bool(&json, "yes", true);
    iwn_out_text(&json, "text", "plain");
    iwn_out_text(&json, "escaped", "a\n\"b\xFF");
    iwn_out_null(&json, "null");
    iwn_out_span(&json, iwn_span("whole"), iwn_span("{\"a\":[1,2]}"));
    iwn_out_close(&json, '}');
    return iwn_out_finish(&json);
}

TEST(test_json_elements_need_exactly_their_length) {
    char whole[512];
    const size_t length = write_elements();
    memcpy(whole, line, length);
    for (size_t size = 1; size <= length + 1U; size++) {
        memset(line, 0x5A, sizeof line);
        iwn_out_init(&json, line, size);
        TEST_ASSERT_EQUAL_UINT((size > length) ? length : 0U, write_elements());
        TEST_ASSERT_EQUAL_HEX8(0x5A, line[size]);
    }
    TEST_ASSERT_EQUAL_STRING_LEN(whole, line, length);
    TEST_ASSERT_EQUAL_STRING_LEN(
        "{\"int\":-1234567,\"yes\":true,\"text\":\"plain\",\"escaped\":\"a\\u000A\\\"b\\uFFFD\",\"null\":null,"
        "\"whole\":{\"a\":[1,2]}}\n",
        line, length);
}

TEST(test_json_frame_has_its_bytes_kind_and_flags) {
    const iw_can_frame_t frame = {.id = 0x10AU, .dlc = 3, .kind = (uint8_t)IW_CAN_ECHO, .data = {0x00, 0x9F, 0xA0}};
    iwn_out_frame(&frame, 17, &json);
    expect("\"t_us\":17,\"id\":266,\"dlc\":3,\"data\":\"009FA0\",\"kind\":\"echo\",\"flags\":[]");
    setUp();
    const iw_can_frame_t odd = {.id = IW_CAN_EXTENDED | IW_CAN_REMOTE | 0x1FFFFFFFU, .dlc = 0};
    iwn_out_frame(&odd, 0, &json);
    expect("\"t_us\":0,\"id\":536870911,\"dlc\":0,\"data\":\"\",\"kind\":\"received\",\"flags\":[\"extended\","
           "\"remote\"]");
}
