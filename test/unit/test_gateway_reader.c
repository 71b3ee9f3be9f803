// SPDX-License-Identifier: MIT
// Recordings for clients: which names are read, and the content of a piece.
#include "box/box.h"
#include "disk/box_files.h"

#include "iwheel_northbound/line.h"

#include "box_end.h"
#include "folder.h"
#include "unit.h"
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define LOG "stop-000001-estop_line.log"

static char directory[80];
static gw_box_answer_t answer;

void setUp(void) {
    folder_make();
    (void)snprintf(directory, sizeof directory, "%s/records", folder);
    TEST_ASSERT_EQUAL(0, mkdir(directory, 0755));
}

void tearDown(void) {
    folder_remove();
}

static const char *path_of(const char *name) {
    static char path[256];
    (void)snprintf(path, sizeof path, "%s/%s", directory, name);
    return path;
}

/// Returns a byte of a sequence that does not repeat near the length of a piece.
static uint8_t byte_at(size_t i) {
    return (uint8_t)(i * 31U + i / 251U);
}

static void make(const char *name, size_t from, size_t to) {
    FILE *file = fopen(path_of(name), (from == 0U) ? "w" : "a");
    TEST_ASSERT_NOT_NULL(file);
    for (size_t i = from; i < to; i++) {
        TEST_ASSERT_EQUAL(byte_at(i), fputc(byte_at(i), file));
    }
    TEST_ASSERT_EQUAL(0, fclose(file));
}

static iwn_error_t ask(const char *name, int64_t offset) {
    gw_box_question_t question = {.client = 7, .offset = offset};
    (void)snprintf(question.name, sizeof question.name, "%s", name);
    memset(&answer, 0x5A, sizeof answer);
    gw_box_reader_answer(directory, &question, &answer);
    TEST_ASSERT_EQUAL(7, answer.client);
    TEST_ASSERT_LESS_THAN(sizeof answer.text, answer.length);
    answer.text[answer.length] = '\0';
    TEST_ASSERT_NULL_MESSAGE(strstr(answer.text, folder), "a path left");
    return answer.error;
}

static const char *list(void) {
    const gw_box_question_t question = {.client = 7, .list = true};
    gw_box_reader_answer(directory, &question, &answer);
    TEST_ASSERT_EQUAL(IWN_OK, answer.error);
    answer.text[answer.length] = '\0';
    return answer.text;
}

static void assert_contains(const char *part) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer.text, part), answer.text);
}

static int64_t number(const char *name) {
    const char *at = strstr(answer.text, name);
    TEST_ASSERT_NOT_NULL_MESSAGE(at, name);
    return strtoll(at + strlen(name), NULL, 10);
}

/// Decodes the bytes of `data`.
static size_t decode(uint8_t out[GW_BOX_PIECE]) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *at = strstr(answer.text, "\"data\":\"") + 8;
    size_t length = 0;
    uint32_t bits = 0;
    unsigned held = 0;
    for (; *at != '"' && *at != '='; at++) {
        const char *digit = strchr(digits, *at);
        TEST_ASSERT_NOT_NULL(digit);
        bits = bits << 6U | (uint32_t)(digit - digits);
        held += 6U;
        if (held >= 8U) {
            held -= 8U;
            TEST_ASSERT_LESS_THAN(GW_BOX_PIECE, length);
            out[length++] = (uint8_t)(bits >> held);
        }
    }
    return length;
}

TEST(test_reader_crc_equals_that_of_zlib) {
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926U, iwn_line_crc(0, "123456789", 9));
    const uint32_t first = iwn_line_crc(0, "1234", 4);
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926U, iwn_line_crc(first, "56789", 5));
}

TEST(test_reader_accepts_only_names_of_the_writer) {
    static const char *const good[] = {LOG, "stop-000017-wheel_lost.jsonl", "stop-4294967295-gateway_died.conf",
                                       "stop-123456-abcdefghijklmnopqrstuvwxyz_abcd.jsonl"};
    static const char *const bad[] = {"",
                                      ".",
                                      "..",
                                      "/etc/passwd",
                                      "../" LOG,
                                      "./" LOG,
                                      "records/" LOG,
                                      "/" LOG,
                                      LOG "/",
                                      LOG "/..",
                                      LOG ".",
                                      LOG "~",
                                      " " LOG,
                                      LOG " ",
                                      "stop-000001-estop_line",
                                      "stop-000001-estop_line.txt",
                                      "stop-000001-estop_line.log.conf",
                                      "stop-000001-estop_line..log",
                                      "stop-000001-../estop.log",
                                      "stop-000001-.log",
                                      "stop-000001.log",
                                      "stop-00001-estop_line.log",
                                      "stop-00000000001-estop_line.log",
                                      "stop-+00001-estop_line.log",
                                      "stop-000001-Estop.log",
                                      "stop-000001-e%00.log",
                                      "stop-000001-estop-line.log",
                                      "STOP-000001-estop.log",
                                      "gateway.conf",
                                      "stop-000001-estop_line.LOG",
                                      "stop-000001-\xC3\xA4.log",
                                      "stop-000001-abcdefghijklmnopqrstuvwxyz_abcde_.log",
                                      "stop-1234567890-abcdefghijklmnopqrstuvwxyz_abcdefghijklmnopqrst.jsonl",
                                      "stop-"};
    make(LOG, 0, 10);
    make("gateway.conf", 0, 10);
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(gw_box_files_stem(good[i]) > 0U, good[i]);
    }
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(gw_box_files_stem(bad[i]) > 0U, bad[i]);
        TEST_ASSERT_EQUAL_MESSAGE(IWN_BAD_VALUE, ask(bad[i], 0), bad[i]);
    }
}

TEST(test_reader_refuses_links_pipes_and_folders) {
    make("secret", 0, 10);
    TEST_ASSERT_EQUAL(0, symlink("secret", path_of("stop-000001-a.log")));
    TEST_ASSERT_EQUAL(IWN_DENIED, ask("stop-000001-a.log", 0));
    assert_contains("symbolic link");
    char other[256];
    (void)snprintf(other, sizeof other, "%s", path_of("secret"));
    TEST_ASSERT_EQUAL(0, link(other, path_of("stop-000002-a.log")));
    TEST_ASSERT_EQUAL(IWN_DENIED, ask("stop-000002-a.log", 0));
    TEST_ASSERT_EQUAL(0, mkfifo(path_of("stop-000003-a.log"), 0600));
    TEST_ASSERT_EQUAL(IWN_DENIED, ask("stop-000003-a.log", 0));
    TEST_ASSERT_EQUAL(0, mkdir(path_of("stop-000004-a.log"), 0700));
    TEST_ASSERT_EQUAL(IWN_DENIED, ask("stop-000004-a.log", 0));
}

TEST(test_reader_refuses_directory_link_or_writable_by_all) {
    char elsewhere[80];
    make(LOG, 0, 10);
    TEST_ASSERT_EQUAL(0, chmod(directory, 0777));
    TEST_ASSERT_EQUAL(IWN_DENIED, ask(LOG, 0));
    TEST_ASSERT_EQUAL(0, chmod(directory, 0755));
    TEST_ASSERT_EQUAL(IWN_OK, ask(LOG, 0));
    (void)snprintf(elsewhere, sizeof elsewhere, "%s/elsewhere", folder);
    TEST_ASSERT_EQUAL(0, rename(directory, elsewhere));
    TEST_ASSERT_EQUAL(0, symlink("elsewhere", directory));
    TEST_ASSERT_EQUAL(IWN_DENIED, ask(LOG, 0));
}

TEST(test_reader_pieces_form_the_file_for_every_length) {
    static const size_t sizes[] = {
        0, 1, 2, 3, 4, GW_BOX_PIECE - 1U, GW_BOX_PIECE, GW_BOX_PIECE + 1U, 3U * GW_BOX_PIECE + 2U};
    static uint8_t piece[GW_BOX_PIECE];
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        size_t got = 0;
        uint32_t crc = 0;
        make(LOG, 0, sizes[i]);
        do {
            TEST_ASSERT_EQUAL(IWN_OK, ask(LOG, (int64_t)got));
            TEST_ASSERT_EQUAL(got, number("\"offset\":"));
            TEST_ASSERT_EQUAL(sizes[i], number("\"size\":"));
            const size_t length = decode(piece);
            TEST_ASSERT_TRUE(length > 0U || sizes[i] == 0U);
            for (size_t k = 0; k < length; k++) {
                TEST_ASSERT_EQUAL(byte_at(got + k), piece[k]);
            }
            TEST_ASSERT_EQUAL(iwn_line_crc(0, piece, length), (uint32_t)number("\"crc32\":"));
            crc = iwn_line_crc(crc, piece, length);
            got += length;
            if (got < sizes[i]) {
                assert_contains("\"file_crc32\":null");
            } else {
                TEST_ASSERT_EQUAL(crc, (uint32_t)number("\"file_crc32\":"));
            }
        } while (got < sizes[i]);
        TEST_ASSERT_EQUAL(sizes[i], got);
    }
}

TEST(test_reader_offset_at_end_is_empty_beyond_is_refused) {
    make(LOG, 0, 100);
    TEST_ASSERT_EQUAL(IWN_OK, ask(LOG, 100));
    assert_contains("\"data\":\"\",\"crc32\":0,\"file_crc32\":");
    TEST_ASSERT_EQUAL(IWN_OUT_OF_RANGE, ask(LOG, 101));
    assert_contains("0 to 100");
    TEST_ASSERT_EQUAL(IWN_OUT_OF_RANGE, ask(LOG, -1));
    TEST_ASSERT_EQUAL(IWN_OUT_OF_RANGE, ask(LOG, INT64_MAX));
    TEST_ASSERT_EQUAL(IWN_OUT_OF_RANGE, ask(LOG, INT64_MIN));
}

TEST(test_reader_file_that_changes_between_pieces_is_reported) {
    make(LOG, 0, 10);
    TEST_ASSERT_EQUAL(IWN_OK, ask(LOG, 10));
    make(LOG, 10, 25);
    TEST_ASSERT_EQUAL(IWN_OK, ask(LOG, 10));
    TEST_ASSERT_EQUAL(25, number("\"size\":"));
    uint8_t piece[GW_BOX_PIECE];
    TEST_ASSERT_EQUAL(15, decode(piece));
    TEST_ASSERT_EQUAL(byte_at(10), piece[0]);
    TEST_ASSERT_EQUAL(0, truncate(path_of(LOG), 5));
    TEST_ASSERT_EQUAL(IWN_OUT_OF_RANGE, ask(LOG, 10));
    TEST_ASSERT_EQUAL(0, unlink(path_of(LOG)));
    TEST_ASSERT_EQUAL(IWN_DENIED, ask(LOG, 10));
    assert_contains("does not exist");
}

TEST(test_reader_list_has_recordings_only_oldest_first) {
    TEST_ASSERT_EQUAL_STRING("\"recordings\":[]", list());
    make("stop-000010-wheel_lost.log", 0, 30);
    make("stop-000010-wheel_lost.jsonl", 0, 20);
    make("stop-000010-wheel_lost.conf", 0, 10);
    make("stop-000009-estop_line.jsonl", 0, 5);
    make("notes.log", 0, 5);
    TEST_ASSERT_EQUAL(0, symlink("notes.log", path_of("stop-000011-a.log")));
    const char *nine = strstr(list(), "{\"name\":\"stop-000009-estop_line\",\"cause\":\"estop_line\",\"wall_us\":null,"
                                      "\"log_bytes\":null,\"jsonl_bytes\":5,\"conf_bytes\":null}");
    const char *ten =
        strstr(answer.text, "{\"name\":\"stop-000010-wheel_lost\",\"cause\":\"wheel_lost\",\"wall_us\":1");
    TEST_ASSERT_NOT_NULL_MESSAGE(nine, answer.text);
    TEST_ASSERT_NOT_NULL_MESSAGE(ten, answer.text);
    TEST_ASSERT_TRUE(nine < ten);
    assert_contains("\"log_bytes\":30,\"jsonl_bytes\":20,\"conf_bytes\":10}]");
    TEST_ASSERT_NULL(strstr(answer.text, "notes"));
    TEST_ASSERT_NULL(strstr(answer.text, "000011"));
}

TEST(test_reader_list_has_the_newest_that_fit_into_a_line) {
    for (unsigned i = 1; i <= 3U * GW_BOX_LISTED; i++) {
        char name[GW_BOX_CAUSE_SIZE + 40U];
        (void)snprintf(name, sizeof name, "stop-%010u-abcdefghijklmnopqrstuvwxyz_abcd.jsonl", i);
        make(name, 0, 1);
    }
    (void)list();
    TEST_ASSERT_NULL(strstr(answer.text, "stop-0000000520-"));
    assert_contains("[{\"name\":\"stop-0000000521-");
    assert_contains("stop-0000000780-");
}

static gw_box_t box;

static void wait_for_answer(gw_child_news_t wanted) {
    struct pollfd entry = {.fd = box.reader.fd, .events = POLLIN};
    TEST_ASSERT_EQUAL(1, poll(&entry, 1, 10000));
    TEST_ASSERT_EQUAL(wanted, gw_box_receive(&box));
}

static void open_box(uint16_t seconds) {
    TEST_ASSERT_EQUAL(0, gw_box_open(&box, &(gw_box_config_t){.blackbox_s = seconds, .directory = directory}));
}

TEST(test_reader_refusal_after_a_longer_reply_has_its_own_length) {
    const gw_box_question_t piece = {.client = 9, .name = LOG};
    const gw_box_question_t missing = {.client = 8, .name = "stop-000099-x.log"};
    make(LOG, 0, 3U * GW_BOX_PIECE);
    open_box(2);
    TEST_ASSERT_TRUE(gw_box_ask(&box, &piece));
    wait_for_answer(GW_CHILD_MESSAGE);
    TEST_ASSERT_TRUE(gw_box_ask(&box, &missing));
    wait_for_answer(GW_CHILD_MESSAGE);
    TEST_ASSERT_EQUAL(IWN_DENIED, box.answer.error);
    TEST_ASSERT_EQUAL(box.answer.length, strlen(box.answer.text));
    box_end(&box);
}

TEST(test_reader_frozen_process_does_not_block_the_gateway) {
    const gw_box_question_t question = {.client = 9, .name = LOG};
    make(LOG, 0, 3U * GW_BOX_PIECE);
    open_box(2);
    TEST_ASSERT_TRUE(gw_box_ask(&box, &question));
    wait_for_answer(GW_CHILD_MESSAGE);
    TEST_ASSERT_EQUAL(9, box.answer.client);
    TEST_ASSERT_EQUAL(IWN_OK, box.answer.error);
    TEST_ASSERT_EQUAL(0, kill(box.reader.pid, SIGSTOP));
    unsigned asked = 0;
    while (gw_box_ask(&box, &question)) {
        asked++;
        TEST_ASSERT_LESS_THAN(100000U, asked);
    }
    TEST_ASSERT_GREATER_THAN(64U, asked); // At least one of each client
    TEST_ASSERT_EQUAL(GW_CHILD_SILENT, gw_box_receive(&box));
    TEST_ASSERT_EQUAL(0, kill(box.reader.pid, SIGKILL));
    wait_for_answer(GW_CHILD_ENDED);
    TEST_ASSERT_FALSE(gw_box_ask(&box, &question)); // Too early
    box.reader.started_us = 0;
    TEST_ASSERT_TRUE(gw_box_ask(&box, &question));
    wait_for_answer(GW_CHILD_MESSAGE);
    box_end(&box);
}

TEST(test_reader_without_recordings_has_no_process) {
    const gw_box_question_t question = {.client = 9, .list = true};
    open_box(0);
    TEST_ASSERT_EQUAL(-1, box.reader.fd);
    TEST_ASSERT_FALSE(gw_box_ask(&box, &question));
    TEST_ASSERT_EQUAL(GW_CHILD_SILENT, gw_box_receive(&box));
    box_end(&box);
}
