// SPDX-License-Identifier: MIT
#include "candump_reader.h"

#include "unit.h"
#include <string.h>
#include <unistd.h>

static candump_reader_t reader;
static int ends[2];

void setUp(void) {
    TEST_ASSERT_EQUAL(0, pipe(ends));
    candump_reader_init(&reader, ends[0]);
}

void tearDown(void) {
    (void)close(ends[0]);
    if (ends[1] >= 0) {
        (void)close(ends[1]);
    }
}

static void give_bytes(const char *text, size_t length) {
    TEST_ASSERT_EQUAL(length, write(ends[1], text, length));
}

static void read_text(const char *text) {
    give_bytes(text, strlen(text));
}

static void end_input(void) {
    (void)close(ends[1]);
    ends[1] = -1;
}

/// The whole input is this text.
static void read_all(const char *text) {
    read_text(text);
    end_input();
}

static void expect_frame(uint32_t id, uint64_t line) {
    candump_t frame;
    TEST_ASSERT_EQUAL(CANDUMP_READ_FRAME, candump_reader_next(&reader, &frame));
    TEST_ASSERT_EQUAL_HEX32(id, frame.id);
    TEST_ASSERT_EQUAL_UINT64(line, reader.line);
}

static void expect_bad(uint64_t line, const char *why) {
    candump_t frame;
    TEST_ASSERT_EQUAL(CANDUMP_READ_BAD, candump_reader_next(&reader, &frame));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reader.why, why), reader.why);
    TEST_ASSERT_EQUAL_UINT64(line, reader.line);
}

static void expect_end(void) {
    candump_t frame;
    TEST_ASSERT_EQUAL(CANDUMP_READ_END, candump_reader_next(&reader, &frame));
    TEST_ASSERT_EQUAL(CANDUMP_READ_END, candump_reader_next(&reader, &frame));
}

TEST(test_reader_byte_order_mark_is_skipped) {
    read_all("\xef\xbb\xbf(1.0) can0 100#00\n(1.1) can0 120#00\n");
    expect_frame(0x100, 1);
    expect_frame(0x120, 2);
    expect_end();
}

TEST(test_reader_foreign_format_is_reported_once) {
    candump_t frame;
    read_all("date Tue Nov 14 22:13:20 2023\nbase hex  timestamps absolute\n0.0 1 10A Rx d 0\n");
    TEST_ASSERT_EQUAL(CANDUMP_READ_FOREIGN, candump_reader_next(&reader, &frame));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reader.why, "asc2log"), reader.why);
    expect_end();
}

TEST(test_reader_frame_line_is_never_a_foreign_format) {
    static const char *const lines[] = {"(1.0) can0 100#00\n",
                                        "# a, b [1]\n(1.0) can0 100#00\n",
                                        "; a, b [1]\n(1.0) can0 100#00\n",
                                        "\n(1.0) can0 100#00\n",
                                        " (1.0) a,b 100#00\n",
                                        "(1.0) x[1] 100#00\n"};
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        candump_t frame;
        candump_reader_init(&reader, ends[0]);
        read_text(lines[i]);
        TEST_ASSERT_EQUAL_MESSAGE(CANDUMP_READ_FRAME, candump_reader_next(&reader, &frame), lines[i]);
    }
}

TEST(test_reader_lines_are_returned_with_their_numbers) {
    read_all("(1.0) can0 100#00\r\n\n# comment\n(1.1) can0 120#00\nrubbish\n(1.2) can0 200#\n");
    expect_frame(0x100, 1);
    expect_frame(0x120, 4);
    expect_bad(5, "time in parentheses");
    expect_frame(0x200, 6);
    expect_end();
}

TEST(test_reader_empty_input_ends) {
    end_input();
    expect_end();
}

TEST(test_reader_line_is_returned_before_the_input_ends) {
    read_text("(1.0) can0 100#00\n(1.1) can");
    expect_frame(0x100, 1);
    read_text("0 101#00\n");
    expect_frame(0x101, 2);
    end_input();
    expect_end();
}

TEST(test_reader_last_line_without_newline_is_bad) {
    read_all("(1.0) can0 100#0011\n(1.1) can0 100#00");
    expect_frame(0x100, 1);
    expect_bad(2, "may be cut");
    expect_end();
}

TEST(test_reader_blank_rest_is_ignored) {
    read_all("(1.0) can0 100#0011\n \t");
    expect_frame(0x100, 1);
    expect_end();
}

TEST(test_reader_overlong_line_is_bad_and_the_next_is_read) {
    char long_line[5000];
    memset(long_line, '(', sizeof long_line);
    long_line[sizeof long_line - 1U] = '\n';
    read_text("(1.0) can0 100#00\n");
    give_bytes(long_line, sizeof long_line);
    give_bytes(long_line, sizeof long_line);
    read_all("(1.1) can0 101#00\n");
    expect_frame(0x100, 1);
    expect_bad(2, "longer than any frame");
    expect_bad(3, "longer than any frame");
    expect_frame(0x101, 4);
    expect_end();
}

TEST(test_reader_zero_bytes_are_bad_and_the_next_line_is_read) {
    static const char text[] = "(1.0) can0 100#00\n\0\0\0\n(1.1) can0 101#00\n";
    give_bytes(text, sizeof text - 1U);
    end_input();
    expect_frame(0x100, 1);
    expect_bad(2, "time in parentheses");
    expect_frame(0x101, 3);
    expect_end();
}

TEST(test_reader_invalid_descriptor_is_failed_and_not_end) {
    candump_t frame;
    candump_reader_init(&reader, -1);
    TEST_ASSERT_EQUAL(CANDUMP_READ_FAILED, candump_reader_next(&reader, &frame));
}

TEST(test_reader_input_larger_than_the_buffer_is_complete) {
    uint64_t line = 0;
    for (unsigned round = 0; round < 30U; round++) {
        for (unsigned i = 0; i < 200U; i++) {
            read_text("(1.0) can0 100#0011223344556677\n");
        }
        for (unsigned i = 0; i < 200U; i++) {
            expect_frame(0x100, ++line);
        }
    }
    end_input();
    expect_end();
}
