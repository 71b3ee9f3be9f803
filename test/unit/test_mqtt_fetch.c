// SPDX-License-Identifier: MIT
// Fetches a recording over MQTT from a fake machine: lost replies, a machine that is away, a bridge that restarts,
// refusals and damaged pieces.
#include "fetch.h"

#include "unit.h"

#include <string.h>

#define SECOND_US   1000000U
#define PATIENCE_US (60U * SECOND_US)
/// "123456789" in base64, with its CRC-32 from zlib.crc32.
#define DATA "\"data\":\"MTIzNDU2Nzg5\",\"crc32\":3421780262"

static fetch_t fetch;
static uint64_t now_us;
static const char *verb;
static char asked[512];
static const char *boot;

void setUp(void) {
    now_us = 1000U * SECOND_US;
    boot = "aa";
    fetch_begin(&fetch, "w1", "me", PATIENCE_US, now_us);
}

static bool step(void) {
    return fetch_step(&fetch, now_us, &verb, asked);
}

static void must_ask(const char *which) {
    TEST_ASSERT_TRUE_MESSAGE(step(), which);
    TEST_ASSERT_EQUAL_STRING(which, verb);
}

/// Sends the reply to the open command, with these fields.
static fetch_news_t answer(const char *fields) {
    char text[1024];
    const int length = snprintf(text, sizeof text, "{\"boot\":\"%s\",\"t_us\":%llu,\"cmd\":\"%s\",\"seq\":%lld,%s}",
                                boot, (unsigned long long)now_us, verb, (long long)fetch.seq, fields);
    return fetch_take(&fetch, "reply/me", text, (size_t)length, now_us);
}

/// The machine answers the first question of each connection.
static void greet(void) {
    must_ask("hello");
    (void)answer("\"ok\":true");
}

/// Sends a piece of 9 bytes; `file_crc32` is "null" before the last one.
static fetch_news_t send_piece(unsigned offset, unsigned size, const char *file_crc32) {
    char fields[256];
    (void)snprintf(fields, sizeof fields, "\"ok\":true,\"offset\":%u,\"size\":%u," DATA ",\"file_crc32\":%s", offset,
                   size, file_crc32);
    return answer(fields);
}

static void list(void) {
    greet();
    must_ask("recordings");
    (void)answer(
        "\"ok\":true,\"recordings\":[{\"name\":\"stop-000003-old\",\"cause\":\"old\",\"wall_us\":5,\"log_bytes\":9,"
        "\"jsonl_bytes\":null,\"conf_bytes\":null},{\"name\":\"stop-000017-wheel_lost\",\"cause\":\"wheel_lost\","
        "\"wall_us\":null,\"log_bytes\":18,\"jsonl_bytes\":9,\"conf_bytes\":null},{\"name\":\"../evil\"}]");
    TEST_ASSERT_EQUAL(FETCH_LISTED, fetch.stage);
}

static void begin_fetching(void) {
    list();
    fetch_choose(&fetch, NULL, now_us);
    TEST_ASSERT_EQUAL(FETCH_FETCHING, fetch.stage);
}

TEST(test_fetch_list_has_only_recordings_of_the_machine) {
    list();
    TEST_ASSERT_EQUAL_size_t(2, fetch.count);
    TEST_ASSERT_EQUAL_STRING("stop-000017-wheel_lost", fetch.list[1].name);
    TEST_ASSERT_FALSE(fetch.list[1].wall_us.known);
    TEST_ASSERT_FALSE(fetch.list[1].bytes[0].known);
    TEST_ASSERT_EQUAL_INT64(18, fetch.list[1].bytes[2].value);
    TEST_ASSERT_FALSE(step());
}

TEST(test_fetch_reads_pieces_and_quotes_the_newest_time) {
    begin_fetching();
    now_us += 1000U;
    must_ask("recording");
    TEST_ASSERT_EQUAL_STRING("{\"from\":\"me\",\"seq\":3,\"boot\":\"aa\",\"t_us\":1000000000,"
                             "\"name\":\"stop-000017-wheel_lost.jsonl\",\"offset\":0}",
                             asked);
    TEST_ASSERT_EQUAL(FETCH_PIECE, send_piece(0, 9, "3421780262"));
    TEST_ASSERT_EQUAL_size_t(1, fetch.got_file);
    TEST_ASSERT_EQUAL_MEMORY("123456789", fetch.bytes, 9);
    must_ask("recording");
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"t_us\":1000001000,\"name\":\"stop-000017-wheel_lost.log\",\"offset\":0}"));
    TEST_ASSERT_EQUAL(FETCH_PIECE, send_piece(0, 18, "null"));
    TEST_ASSERT_EQUAL(FETCH_FETCHING, fetch.stage);
    must_ask("recording");
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"offset\":9}"));
    TEST_ASSERT_EQUAL(FETCH_PIECE, send_piece(9, 18, "1266907876"));
    TEST_ASSERT_EQUAL(FETCH_DONE, fetch.stage);
    TEST_ASSERT_EQUAL_UINT64(0, fetch.again);
}

TEST(test_fetch_lost_reply_is_requested_again_with_a_new_time) {
    begin_fetching();
    must_ask("recording");
    now_us += 1999999U;
    TEST_ASSERT_FALSE(step());
    now_us++;
    greet();
    must_ask("recording");
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"seq\":5,\"boot\":\"aa\",\"t_us\":1002000000,"));
    TEST_ASSERT_EQUAL(FETCH_PIECE, send_piece(0, 9, "3421780262"));
    TEST_ASSERT_EQUAL_UINT64(1, fetch.again);
}

TEST(test_fetch_late_reply_is_ignored) {
    begin_fetching();
    must_ask("recording");
    now_us += 2U * SECOND_US;
    must_ask("hello");
    const char *late =
        "{\"boot\":\"aa\",\"t_us\":1,\"cmd\":\"recording\",\"seq\":3,\"ok\":true,\"offset\":0,\"size\":9," DATA
        ",\"file_crc32\":3421780262}";
    TEST_ASSERT_EQUAL(FETCH_NOTHING, fetch_take(&fetch, "reply/me", late, strlen(late), now_us));
    TEST_ASSERT_EQUAL(FETCH_NOTHING, fetch_take(&fetch, "reply/other", late, strlen(late), now_us));
    TEST_ASSERT_EQUAL_INT64(0, fetch.piece.next);
}

TEST(test_fetch_continues_after_a_restart_of_the_bridge) {
    begin_fetching();
    must_ask("recording");
    (void)send_piece(0, 9, "3421780262");
    must_ask("recording");
    (void)send_piece(0, 18, "null");
    must_ask("recording");
    boot = "bb";
    (void)answer(
        "\"ok\":false,\"error\":\"other_boot\",\"message\":\"send it again with boot and t_us of this reply\"");
    must_ask("recording");
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"boot\":\"bb\""));
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"offset\":9}"));
    (void)send_piece(9, 18, "1266907876");
    TEST_ASSERT_EQUAL(FETCH_DONE, fetch.stage);
}

TEST(test_fetch_machine_back_within_the_patience_continues) {
    begin_fetching();
    (void)fetch_take(&fetch, "availability", "offline", 7, now_us);
    for (unsigned i = 0; i < 29U; i++) {
        TEST_ASSERT_TRUE(step());
        now_us += 2U * SECOND_US;
    }
    greet();
    must_ask("recording");
    TEST_ASSERT_EQUAL(FETCH_PIECE, send_piece(0, 9, "3421780262"));
}

TEST(test_fetch_machine_that_stays_offline_fails_with_the_reason) {
    begin_fetching();
    (void)fetch_take(&fetch, "availability", "offline", 7, now_us);
    now_us += PATIENCE_US;
    TEST_ASSERT_FALSE(step());
    TEST_ASSERT_EQUAL(FETCH_FAILED, fetch.stage);
    TEST_ASSERT_EQUAL_INT(75, fetch.code);
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "w1 has not answered for 60 s and is offline"));
}

TEST(test_fetch_unknown_machine_fails_after_6_s) {
    must_ask("hello");
    now_us += 6U * SECOND_US;
    TEST_ASSERT_FALSE(step());
    TEST_ASSERT_EQUAL_INT(69, fetch.code);
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "this broker has no machine w1"));
}

TEST(test_fetch_damaged_piece_is_retried_then_fails) {
    begin_fetching();
    for (unsigned i = 0; i < 6U; i++) {
        TEST_ASSERT_EQUAL(FETCH_FETCHING, fetch.stage);
        must_ask("recording");
        TEST_ASSERT_EQUAL(FETCH_NOTHING,
                          answer("\"ok\":true,\"offset\":0,\"size\":18,\"data\":\"MTIzNDU2Nzg5\",\"crc32\":1,"
                                 "\"file_crc32\":null"));
    }
    TEST_ASSERT_EQUAL(FETCH_FAILED, fetch.stage);
    TEST_ASSERT_EQUAL_INT(65, fetch.code);
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "the checksum of stop-000017-wheel_lost.jsonl of w1 is wrong"));
}

TEST(test_fetch_incomplete_file_is_never_done) {
    begin_fetching();
    for (unsigned i = 0; i < 6U; i++) {
        must_ask("recording");
        TEST_ASSERT_EQUAL(FETCH_NOTHING, send_piece(0, 9, "7"));
    }
    TEST_ASSERT_EQUAL(FETCH_FAILED, fetch.stage);
}

TEST(test_fetch_permanent_refusal_fails_temporary_one_is_retried) {
    begin_fetching();
    must_ask("recording");
    (void)answer("\"ok\":false,\"error\":\"bad_value\",\"message\":\"no\\u001b such name\"");
    TEST_ASSERT_EQUAL(FETCH_FAILED, fetch.stage);
    TEST_ASSERT_EQUAL_STRING("w1 refuses: no? such name", fetch.why);
    setUp();
    begin_fetching();
    for (unsigned i = 0; i < 6U; i++) {
        TEST_ASSERT_EQUAL(FETCH_FETCHING, fetch.stage);
        TEST_ASSERT_EQUAL(i == 0U, step());
        now_us += (i > 0U) ? SECOND_US / 2U : 0U;
        if (i > 0U) {
            greet();
            must_ask("recording");
        }
        (void)answer("\"ok\":false,\"error\":\"denied\",\"message\":\"still being read\"");
    }
    TEST_ASSERT_EQUAL_INT(1, fetch.code);
}

TEST(test_fetch_always_late_fails_with_the_last_reason) {
    begin_fetching();
    unsigned sent = 0;
    while (fetch.stage == FETCH_FETCHING) {
        if (step()) {
            sent++;
            (void)answer((strcmp(verb, "hello") == 0)
                             ? "\"ok\":true"
                             : "\"ok\":false,\"error\":\"late\",\"message\":\"too long on the way\"");
        }
        now_us += 50000U;
    }
    TEST_ASSERT_EQUAL_INT(75, fetch.code);
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "its last message: too long on the way"));
    TEST_ASSERT_LESS_THAN_UINT(300, sent);
}

TEST(test_fetch_recording_is_selected_by_name_or_number) {
    list();
    fetch_choose(&fetch, "3", now_us);
    TEST_ASSERT_EQUAL_size_t(0, fetch.chosen);
    fetch.stage = FETCH_LISTED;
    fetch_choose(&fetch, "stop-000017-wheel_lost", now_us);
    TEST_ASSERT_EQUAL_size_t(1, fetch.chosen);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(1, fetch.file, "it has no .conf");
    fetch_choose(&fetch, "18", now_us);
    TEST_ASSERT_EQUAL(FETCH_FAILED, fetch.stage);
    TEST_ASSERT_EQUAL_STRING("w1 has no recording 18; it has: iwheel-fleet recordings w1", fetch.why);
}

TEST(test_fetch_without_recordings_fails_with_the_reason) {
    greet();
    must_ask("recordings");
    (void)answer("\"ok\":true,\"recordings\":[]");
    fetch_choose(&fetch, NULL, now_us);
    TEST_ASSERT_EQUAL_INT(1, fetch.code);
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "w1 has no recording"));
}

TEST(test_fetch_garbage_changes_nothing) {
    static const char *const texts[] = {"", "{", "[]", "{\"seq\":1}", "{\"seq\":1,\"t_us\":\"x\",\"ok\":true}"};
    must_ask("hello");
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        TEST_ASSERT_EQUAL(FETCH_NOTHING, fetch_take(&fetch, "reply/me", texts[i], strlen(texts[i]), now_us));
        TEST_ASSERT_NOT_EQUAL(FETCH_NONE, fetch.asked);
    }
}
