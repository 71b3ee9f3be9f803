// SPDX-License-Identifier: MIT
#include "candump.h"

#include "unit.h"
#include <stdio.h>
#include <string.h>

/// Parses from memory without a terminator, so that a sanitizer detects a read beyond the length.
static candump_result_t parse(const char *line, candump_t *out, const char **out_why) {
    char exact[512];
    const size_t length = strlen(line);
    memset(exact, 'A', sizeof exact);
    memcpy(&exact[sizeof exact - length], line, length);
    return candump_parse(&exact[sizeof exact - length], length, out, out_why);
}

static candump_t good(const char *line) {
    candump_t frame;
    const char *why = "";
    memset(&frame, 0xA5, sizeof frame);
    TEST_ASSERT_EQUAL_MESSAGE(CANDUMP_FRAME, parse(line, &frame, &why), line);
    return frame;
}

static void check_bad(const char *line, const char *part_of_why) {
    candump_t frame;
    candump_t before;
    const char *why = "";
    memset(&frame, 0xA5, sizeof frame);
    before = frame;
    TEST_ASSERT_EQUAL_MESSAGE(CANDUMP_BAD, parse(line, &frame, &why), line);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, part_of_why), why);
    TEST_ASSERT_EQUAL_MEMORY(&before, &frame, sizeof frame);
}

TEST(test_candump_standard_frame_is_parsed) {
    const candump_t frame = good("(1760000000.123456) can0 10A#0101F40064");
    const uint8_t data[] = {1, 1, 0xF4, 0, 0x64};
    TEST_ASSERT_EQUAL_INT64(1760000000123456, frame.time_us);
    TEST_ASSERT_EQUAL_STRING("can0", frame.interface);
    TEST_ASSERT_EQUAL_HEX32(266, frame.id);
    TEST_ASSERT_EQUAL(5, frame.length);
    TEST_ASSERT_EQUAL_MEMORY(data, frame.data, sizeof data);
    TEST_ASSERT_EQUAL(CANDUMP_UNMARKED, frame.mark);
    TEST_ASSERT_FALSE(frame.extended || frame.remote || frame.error || frame.fd);
}

TEST(test_candump_mark_selects_received_or_sent) {
    TEST_ASSERT_EQUAL(CANDUMP_RECEIVED, good("(1.0) can0 100#00 R").mark);
    TEST_ASSERT_EQUAL(CANDUMP_SENT, good("(1.0) can0 100#00  T").mark);
    TEST_ASSERT_EQUAL(CANDUMP_SENT, good("(1.0) can0 100# t").mark);
    TEST_ASSERT_EQUAL(IW_CAN_ECHO, candump_to_core(&(candump_t){.mark = CANDUMP_SENT}).kind);
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, candump_to_core(&(candump_t){.mark = CANDUMP_UNMARKED}).kind);
}

TEST(test_candump_line_end_is_not_part_of_the_frame) {
    TEST_ASSERT_EQUAL(1, good("(1.000001) can0 100#AB\r\n").length);
    TEST_ASSERT_EQUAL(1, good("  (1.000001)\tcan0\t100#ab  \t\n").length);
}

TEST(test_candump_time_has_zero_to_nine_decimals) {
    TEST_ASSERT_EQUAL_INT64(1500000, good("(1.5) c 100#").time_us);
    TEST_ASSERT_EQUAL_INT64(1000001, good("(1.000001999) c 100#").time_us);
    TEST_ASSERT_EQUAL_INT64(7000000, good("(7) c 100#").time_us);
    TEST_ASSERT_EQUAL_INT64(999999999999999999, good("(999999999999.999999) c 100#").time_us);
    check_bad("(1.) c 100#", "time");
    check_bad("(.5) c 100#", "time");
    check_bad("(-1.5) c 100#", "time");
    check_bad("(1.0000000001) c 100#", "time");
    check_bad("(1234567890123.0) c 100#", "time");
    check_bad("(1e9) c 100#", "time");
    check_bad("(1.5 c 100#", "time");
}

TEST(test_candump_frame_formats_are_distinguished) {
    candump_t frame = good("(1.0) can0 0000010A#00");
    TEST_ASSERT_TRUE(frame.extended);
    TEST_ASSERT_EQUAL_HEX32(266U | IW_CAN_EXTENDED, candump_to_core(&frame).id);
    frame = good("(1.0) can0 10A#R5");
    TEST_ASSERT_TRUE(frame.remote);
    TEST_ASSERT_EQUAL(5, frame.length);
    TEST_ASSERT_EQUAL_HEX32(266U | IW_CAN_REMOTE, candump_to_core(&frame).id);
    frame = good("(1.0) can0 20000088#0000000000000000");
    TEST_ASSERT_TRUE(frame.error);
    TEST_ASSERT_FALSE(frame.extended);
    TEST_ASSERT_EQUAL_HEX32(0x88U | IW_CAN_ERROR, candump_to_core(&frame).id);
    frame = good("(1.0) can0 10A##300112233445566778899AABB");
    TEST_ASSERT_TRUE(frame.fd);
    TEST_ASSERT_EQUAL(3, frame.fd_flags);
    TEST_ASSERT_EQUAL(12, frame.length);
    TEST_ASSERT_EQUAL_HEX32(266U | IW_CAN_FD, candump_to_core(&frame).id);
    TEST_ASSERT_EQUAL(8, candump_to_core(&frame).dlc);
    TEST_ASSERT_EQUAL(8, good("(1.0) can0 100#1122334455667788_F").length);
    TEST_ASSERT_EQUAL(2, good("(1.0) can0 100#11.22").length);
}

TEST(test_candump_blank_lines_and_comments_are_empty) {
    candump_t frame;
    const char *why;
    const char *const lines[] = {"", "\n", " \t\r\n", "# a comment", "; another", "  # (1.0) can0 100#00"};
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(CANDUMP_EMPTY, parse(lines[i], &frame, &why), lines[i]);
    }
}

TEST(test_candump_bad_line_is_refused_with_the_reason) {
    check_bad("can0  10A   [5]  01 01 F4 00 64", "candump -L");
    check_bad("(1.0)  can0  10A   [5]  01 01 F4 00 64", "screen form");
    check_bad("(1.0)", "cut");
    check_bad("(1.0) can0", "cut");
    check_bad("(1.0) can0 10", "screen form");
    check_bad("(1.0) can0 10A", "screen form");
    check_bad("(1.0) can0 G0A#00", "hexadecimal id");
    check_bad("(1.0) can0 0266#00", "3 hexadecimal digits");
    check_bad("(1.0) can0 800#00", "7FF");
    check_bad("(1.0) can0 FFFFFFFF#00", "1FFFFFFF");
    check_bad("(1.0) can0 40000123#00", "1FFFFFFF");
    check_bad("(1.0) can0 123456789#00", "3 hexadecimal digits");
    check_bad("(1.0) can0 1234567890#00", "hexadecimal id");
    check_bad("(1.0) can0 10A#012", "odd");
    check_bad("(1.0) can0 10A#010203040506070809", "more data");
    check_bad("(1.0) can0 10A##", "flags");
    check_bad("(1.0) can0 10A#R9", "8 bytes");
    check_bad("(1.0) can0 10A#00_9", "length code");
    check_bad("(1.0) can0 10A#00 X", "neither R nor T");
    check_bad("(1.0) can0 10A#00R", "neither R nor T");
    check_bad("(1.0) can0 10A#00 R R", "neither R nor T");
    check_bad("(1.0) a-name-that-is-longer-than-any-interface 10A#00", "interface");
    check_bad("(1.0) ca\x01n 10A#00", "interface");
}

TEST(test_candump_fd_frame_has_at_most_64_bytes) {
    char line[256] = "(1.0) can0 10A##0";
    for (int i = 0; i < 64; i++) {
        (void)strcat(line, "5A");
    }
    TEST_ASSERT_EQUAL(64, good(line).length);
    check_bad(strcat(line, "5A"), "more data");
}

static void check_round_trip(const char *line) {
    char written[CANDUMP_LINE_SIZE];
    const candump_t frame = good(line);
    TEST_ASSERT_EQUAL(strlen(line), candump_write(&frame, written));
    TEST_ASSERT_EQUAL_STRING(line, written);
}

TEST(test_candump_parsed_frame_is_written_as_the_same_line) {
    check_round_trip("(1760000000.000001) can0 10A#0101F40064\n");
    check_round_trip("(0.000000) vcan1 7FF# R\n");
    check_round_trip("(999999999999.999999) can0 1FFFFFFF#1122334455667788 T\n");
    check_round_trip("(1.000000) can0 123#R\n");
    check_round_trip("(1.000000) can0 00000123#R8\n");
    check_round_trip("(1.000000) can0 20000004#0010000000000000\n");
    check_round_trip("(1.000000) can0 123##1AABBCCDDEEFF00112233 R\n");
    check_round_trip("(1.000000) can0 123##0\n");
}

TEST(test_candump_longest_line_fits) {
    char line[CANDUMP_LINE_SIZE];
    candump_t frame = {.time_us = 999999999999999999, .id = CANDUMP_ID_MASK, .extended = true, .fd = true};
    frame.mark = CANDUMP_SENT;
    frame.length = CANDUMP_DATA_MAX;
    memset(frame.interface, 'a', sizeof frame.interface - 1U);
    TEST_ASSERT_LESS_THAN(CANDUMP_LINE_SIZE, candump_write(&frame, line));
    TEST_ASSERT_EQUAL(64, good(line).length);
}

TEST(test_candump_interface_is_written_as_letters_and_digits) {
    char line[CANDUMP_LINE_SIZE];
    const iw_can_frame_t core = {.id = 266, .dlc = 1, .kind = IW_CAN_ECHO, .data = {7}};
    candump_t frame = candump_from_core(&core, 1, "unix:/run/iwheel/a-bus_1.sock.that.is.longer.than.any");
    (void)candump_write(&frame, line);
    TEST_ASSERT_EQUAL_STRING("(0.000001) unixruniwheelabus1sockt 10A#07 T\n", line);
    frame = candump_from_core(&core, 1, "--");
    (void)candump_write(&frame, line);
    TEST_ASSERT_EQUAL_STRING("(0.000001) can 10A#07 T\n", line);
}

TEST(test_candump_core_frame_is_unchanged_by_write_and_parse) {
    static const uint32_t ids[] = {0, 0x7FF, 266, 0x1FFFFFFF | IW_CAN_EXTENDED, 266 | IW_CAN_REMOTE, 266 | IW_CAN_FD};
    for (size_t i = 0; i < sizeof ids / sizeof ids[0]; i++) {
        for (uint8_t dlc = 0; dlc <= IW_CAN_DATA_MAX; dlc++) {
            iw_can_frame_t core = {.id = ids[i], .dlc = dlc, .kind = i & 1U};
            char line[CANDUMP_LINE_SIZE];
            for (uint8_t j = 0; j < dlc && (ids[i] & IW_CAN_REMOTE) == 0U; j++) {
                core.data[j] = (uint8_t)(0xF0U + j);
            }
            candump_t frame = candump_from_core(&core, 5, "can0");
            (void)candump_write(&frame, line);
            frame = good(line);
            const iw_can_frame_t back = candump_to_core(&frame);
            TEST_ASSERT_EQUAL_HEX32(core.id, back.id);
            TEST_ASSERT_EQUAL(core.dlc, back.dlc);
            TEST_ASSERT_EQUAL(core.kind, back.kind);
            TEST_ASSERT_EQUAL_MEMORY(core.data, back.data, sizeof core.data);
        }
    }
}

/// Every prefix and every single wrong byte of lines of all formats has a result, without a read beyond the length.
TEST(test_candump_damaged_lines_never_read_beyond_the_length) {
    static const char *const lines[] = {"(1.5) can0 10A#0101F40064 T", "(1.5) can0 10A##1001122 R",
                                        "(1.5) can0 0000010A#R5", "(1.5) can0 100#1122334455667788_F"};
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        for (size_t at = 0; at < strlen(lines[i]); at++) {
            candump_t frame;
            const char *why;
            char damaged[64];
            (void)snprintf(damaged, sizeof damaged, "%.*s", (int)at, lines[i]);
            TEST_ASSERT_LESS_OR_EQUAL(CANDUMP_BAD, parse(damaged, &frame, &why));
            for (unsigned byte = 1; byte < 256U; byte++) {
                (void)snprintf(damaged, sizeof damaged, "%s", lines[i]);
                damaged[at] = (char)byte;
                TEST_ASSERT_LESS_OR_EQUAL(CANDUMP_BAD, parse(damaged, &frame, &why));
            }
        }
    }
}
