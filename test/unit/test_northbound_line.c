// SPDX-License-Identifier: MIT
// Lines on a serial line: each has one spelling, all other bytes are refused, and the receiver recovers at the next
// newline.
#include "iwheel_northbound/line.h"

#include "unit.h"

#include <string.h>

static char bytes[256];
static char buffer[64];
static iwn_receiver_t receiver;
static iwn_line_t line;

void setUp(void) {
    memset(bytes, 0x5A, sizeof bytes);
    memset(&line, 0xA5, sizeof line);
    iwn_receiver_init(&receiver, buffer, sizeof buffer, false);
}

static iwn_line_t made(uint8_t channel, const char *json) {
    return (iwn_line_t){.channel = channel, .json = json, .length = strlen(json)};
}

static iwn_line_t stamped(uint8_t channel, uint64_t t_us, const char *json) {
    iwn_line_t made_line = made(channel, json);
    made_line.stamped = true;
    made_line.t_us = t_us;
    return made_line;
}

/// Writes `text` as a line with the right CRC and without its newline; returns the length.
static size_t checked(const char *text) {
    memcpy(bytes, text, strlen(text));
    return iwn_line_end(bytes, strlen(text), sizeof bytes) - 1U;
}

/// Returns the last verdict of the receiver, and the number of verdicts.
static iwn_line_verdict_t put(const char *text, unsigned *out_verdicts) {
    iwn_line_verdict_t last = IWN_LINE_NOTHING;
    *out_verdicts = 0;
    for (const char *c = text; *c != '\0'; c++) {
        const iwn_line_verdict_t verdict = iwn_receiver_put(&receiver, *c, &line);
        if (verdict != IWN_LINE_NOTHING) {
            last = verdict;
            (*out_verdicts)++;
        }
    }
    return last;
}

TEST(test_line_crc_is_iso_hdlc_and_may_be_continued) {
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926U, iwn_line_crc(0, "123456789", 9));
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926U, iwn_line_crc(iwn_line_crc(0, "1234", 4), "56789", 5));
    TEST_ASSERT_EQUAL_HEX32(0U, iwn_line_crc(0, "", 0));
}

TEST(test_line_is_written_as_documented) {
    const iwn_line_t to_board = made(0, "{\"cmd\":\"link\"}");
    size_t length = iwn_line_write(&to_board, bytes, sizeof bytes);
    TEST_ASSERT_EQUAL_STRING_LEN("0 {\"cmd\":\"link\"}*e2d27f9b\n", bytes, length);
    TEST_ASSERT_EQUAL_UINT(26, length);
    const iwn_line_t to_host = stamped(3, 1250000, "{\"ok\":true}");
    length = iwn_line_write(&to_host, bytes, sizeof bytes);
    TEST_ASSERT_EQUAL_STRING_LEN("3 1250000 {\"ok\":true}*e0f15d9c\n", bytes, length);
}

TEST(test_line_of_any_channel_and_stamp_is_read_back_unchanged) {
    static const uint64_t stamps[] = {0, 9, 10, 4294967296U, UINT64_MAX};
    for (uint8_t channel = 0; channel <= IWN_LINE_CHANNELS; channel++) {
        for (unsigned i = 0; i < sizeof stamps / sizeof stamps[0]; i++) {
            const iwn_line_t sent = stamped(channel, stamps[i], "{\"a\":\"*\"}");
            const size_t length = iwn_line_write(&sent, bytes, sizeof bytes);
            TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, iwn_line_read(bytes, length - 1U, true, &line));
            TEST_ASSERT_EQUAL_UINT(channel, line.channel);
            TEST_ASSERT_TRUE(line.t_us == stamps[i] && line.stamped);
            TEST_ASSERT_EQUAL_STRING_LEN(sent.json, line.json, line.length);
            TEST_ASSERT_EQUAL_UINT(sent.length, line.length);
        }
    }
}

TEST(test_line_that_does_not_fit_is_not_written_at_any_size) {
    const iwn_line_t sent = stamped(8, 77, "{\"ok\":true}");
    const size_t whole = iwn_line_write(&sent, bytes, sizeof bytes);
    for (size_t size = 0; size < whole; size++) {
        memset(bytes, 0x5A, sizeof bytes);
        TEST_ASSERT_EQUAL_UINT(0, iwn_line_write(&sent, bytes, size));
        TEST_ASSERT_EQUAL_HEX8(0x5A, bytes[size]);
    }
    TEST_ASSERT_EQUAL_UINT(whole, iwn_line_write(&sent, bytes, whole));
    const iwn_line_t beyond = made(IWN_LINE_CHANNELS + 1U, "{}");
    TEST_ASSERT_EQUAL_UINT(0, iwn_line_write(&beyond, bytes, sizeof bytes));
}

TEST(test_line_with_any_flipped_bit_is_refused) {
    const iwn_line_t sent = stamped(3, 1250000, "{\"ok\":true}");
    const size_t length = iwn_line_write(&sent, bytes, sizeof bytes) - 1U;
    for (size_t bit = 0; bit < length * 8U; bit++) {
        bytes[bit / 8U] = (char)(bytes[bit / 8U] ^ (char)(1U << bit % 8U));
        TEST_ASSERT_NOT_EQUAL(IWN_LINE_GOOD, iwn_line_read(bytes, length, true, &line));
        bytes[bit / 8U] = (char)(bytes[bit / 8U] ^ (char)(1U << bit % 8U));
    }
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, iwn_line_read(bytes, length, true, &line));
}

TEST(test_line_cut_anywhere_or_doubled_is_refused) {
    const iwn_line_t sent = made(1, "{\"cmd\":\"stop\"}");
    const size_t length = iwn_line_write(&sent, bytes, sizeof bytes) - 1U;
    for (size_t cut = 0; cut < length; cut++) {
        TEST_ASSERT_NOT_EQUAL(IWN_LINE_GOOD, iwn_line_read(bytes, cut, false, &line));
        TEST_ASSERT_NOT_EQUAL(IWN_LINE_GOOD, iwn_line_read(&bytes[cut + 1U], length - cut - 1U, false, &line));
    }
    memcpy(&bytes[length], bytes, length);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_CORRUPT, iwn_line_read(bytes, 2U * length, false, &line));
}

TEST(test_line_with_a_right_crc_and_a_wrong_form_is_malformed) {
    static const char *const wrong[] = {"",      "1",     "1 ",   "1 {",   "9 {}", "1{}",   "01 {}", "-1 {}",
                                        "1  {}", "1 {} ", "1 []", "1 {}x", "a {}", "1\t{}", "1 7 {}"};
    for (unsigned i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(IWN_LINE_MISFORMED, iwn_line_read(bytes, checked(wrong[i]), false, &line),
                                      wrong[i]);
    }
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, iwn_line_read(bytes, checked("8 {}"), false, &line));
}

TEST(test_line_stamp_has_one_spelling) {
    static const char *const wrong[] = {"1 {}",
                                        "1  {}",
                                        "1 01 {}",
                                        "1 -1 {}",
                                        "1 7{}",
                                        "1 7",
                                        "1 7 ",
                                        "1 x {}",
                                        "1 18446744073709551616 {}",
                                        "1 99999999999999999999 {}",
                                        "1 7  {}"};
    for (unsigned i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(IWN_LINE_MISFORMED, iwn_line_read(bytes, checked(wrong[i]), true, &line),
                                      wrong[i]);
    }
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, iwn_line_read(bytes, checked("1 0 {}"), true, &line));
}

TEST(test_line_without_crc_or_with_upper_case_is_unchecked) {
    TEST_ASSERT_EQUAL_INT(IWN_LINE_UNCHECKED, iwn_line_read("0 {\"cmd\":\"link\"}", 16, false, &line));
    TEST_ASSERT_EQUAL_INT(IWN_LINE_UNCHECKED, iwn_line_read("0 {\"cmd\":\"link\"}*E2D27F9B", 25, false, &line));
    TEST_ASSERT_EQUAL_INT(IWN_LINE_UNCHECKED, iwn_line_read("0 {\"cmd\":\"link\"}*e2d27f9b\r", 26, false, &line));
    TEST_ASSERT_EQUAL_STRING("no_crc", iwn_line_verdict_name(IWN_LINE_UNCHECKED));
    TEST_ASSERT_EQUAL_STRING("unknown", iwn_line_verdict_name(IWN_LINE_VERDICTS));
}

TEST(test_receiver_returns_each_line_once_and_skips_empty_ones) {
    unsigned verdicts = 0;
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, put("\n\n0 {\"cmd\":\"link\"}*e2d27f9b\n\n", &verdicts));
    TEST_ASSERT_EQUAL_UINT(1, verdicts);
    TEST_ASSERT_EQUAL_STRING_LEN("{\"cmd\":\"link\"}", line.json, line.length);
}

TEST(test_receiver_recovers_at_the_newline_after_half_a_line) {
    unsigned verdicts = 0;
    TEST_ASSERT_EQUAL_INT(IWN_LINE_UNCHECKED, put("nk\"}*e2d\n", &verdicts));
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, put("0 {\"cmd\":\"link\"}*e2d27f9b\n", &verdicts));
    TEST_ASSERT_EQUAL_UINT(1, verdicts);
}

TEST(test_receiver_reports_a_long_line_once_and_recovers) {
    unsigned verdicts = 0;
    for (unsigned i = 0; i < 100U * sizeof buffer; i++) {
        TEST_ASSERT_EQUAL_INT(IWN_LINE_NOTHING, iwn_receiver_put(&receiver, 'x', &line));
        TEST_ASSERT_TRUE(receiver.length < sizeof buffer);
    }
    TEST_ASSERT_EQUAL_INT(IWN_LINE_TOO_BIG, put("\n", &verdicts));
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, put("0 {\"cmd\":\"link\"}*e2d27f9b\n", &verdicts));
}

TEST(test_receiver_accepts_a_line_of_its_buffer_size_at_most) {
    char receive_buffer[26];
    unsigned verdicts = 0;
    iwn_receiver_init(&receiver, receive_buffer, sizeof receive_buffer, false);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, put("0 {\"cmd\":\"link\"}*e2d27f9b\n", &verdicts));
    iwn_receiver_init(&receiver, receive_buffer, sizeof receive_buffer - 1U, false);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_TOO_BIG, put("0 {\"cmd\":\"link\"}*e2d27f9b\n", &verdicts));
}

TEST(test_receiver_drops_a_line_with_lost_bytes) {
    unsigned verdicts = 0;
    (void)put("0 {\"cmd\":", &verdicts);
    iwn_receiver_spoil(&receiver);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_LOST, put("\"link\"}*e2d27f9b\n", &verdicts));
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, put("0 {\"cmd\":\"link\"}*e2d27f9b\n", &verdicts));
}

static const char drive[] = "{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":2}";

TEST(test_quote_is_written_before_the_fields_and_removed_again) {
    const iwn_quote_t quote = {.boot = "0123456789abcdef", .seq = 7, .t_us = 1250000};
    char *json = bytes;
    iwn_quote_t accepted;
    size_t length = iwn_quote_write(&quote, drive, sizeof drive - 1U, bytes, sizeof bytes);
    TEST_ASSERT_EQUAL_STRING_LEN("{\"boot\":\"0123456789abcdef\",\"seq\":7,\"t_us\":1250000,\"cmd\":\"drive\",", bytes,
                                 64);
    TEST_ASSERT_TRUE(iwn_quote_take(&json, &length, &accepted));
    TEST_ASSERT_EQUAL_UINT(sizeof drive - 1U, length);
    TEST_ASSERT_EQUAL_STRING_LEN(drive, json, length);
    TEST_ASSERT_EQUAL_STRING(quote.boot, accepted.boot);
    TEST_ASSERT_TRUE(accepted.seq == 7U && accepted.t_us == 1250000U);
}

TEST(test_quote_of_the_largest_numbers_fits_its_size) {
    const iwn_quote_t quote = {.boot = "ffffffffffffffff", .seq = UINT64_MAX, .t_us = UINT64_MAX};
    const size_t needed = sizeof drive - 1U + IWN_QUOTE_SIZE;
    char *json = bytes;
    iwn_quote_t accepted;
    TEST_ASSERT_EQUAL_UINT(0, iwn_quote_write(&quote, drive, sizeof drive - 1U, bytes, needed - 1U));
    size_t length = iwn_quote_write(&quote, drive, sizeof drive - 1U, bytes, needed);
    TEST_ASSERT_TRUE(length > 0U && length < needed);
    TEST_ASSERT_TRUE(iwn_quote_take(&json, &length, &accepted) && accepted.seq == UINT64_MAX &&
                     accepted.t_us == UINT64_MAX);
    TEST_ASSERT_EQUAL_STRING_LEN(drive, json, length);
}

TEST(test_quote_in_another_spelling_is_not_read) {
    static const char *const wrong[] = {
        "{\"cmd\":\"drive\"}",
        "{\"boot\":\"0123456789ABCDEF\",\"seq\":1,\"t_us\":1,\"cmd\":\"drive\"}",
        "{\"boot\":\"0123456789abcde\",\"seq\":1,\"t_us\":1,\"cmd\":\"drive\"}",
        "{\"boot\":\"0123456789abcdef\",\"seq\":01,\"t_us\":1,\"cmd\":\"drive\"}",
        "{\"boot\":\"0123456789abcdef\",\"seq\":-1,\"t_us\":1,\"cmd\":\"drive\"}",
        "{\"boot\":\"0123456789abcdef\",\"t_us\":1,\"seq\":1,\"cmd\":\"drive\"}",
        "{\"boot\":\"0123456789abcdef\",\"seq\":1,\"t_us\":1}",
        "{\"boot\":\"0123456789abcdef\",\"seq\":1,\"t_us\":,\"cmd\":\"drive\"}",
        "{\"boot\":\"01234567",
    };
    for (unsigned i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char *json = bytes;
        size_t length = strlen(wrong[i]);
        iwn_quote_t accepted;
        memcpy(bytes, wrong[i], length);
        TEST_ASSERT_FALSE_MESSAGE(iwn_quote_take(&json, &length, &accepted), wrong[i]);
        TEST_ASSERT_TRUE(json == bytes && length == strlen(wrong[i]));
        TEST_ASSERT_EQUAL_STRING_LEN(wrong[i], bytes, length);
    }
}
