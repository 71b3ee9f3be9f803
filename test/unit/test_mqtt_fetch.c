// SPDX-License-Identifier: MIT
// A recording asked for by MQTT, from a machine that a test plays itself: lost answers, one that was away, that began anew, that refuses, and
// what is damaged.
#include "fetch.h"

#include "unit.h"

#include <string.h>

#define SECOND_US   1000000U
#define PATIENCE_US (60U * SECOND_US)
/// "123456789", as zlib.crc32 has it.
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

/// The answer to the command under way, with these fields.
static fetch_news_t answer(const char *fields) {
    char text[1024];
    const int length = snprintf(text, sizeof text, "{\"boot\":\"%s\",\"t_us\":%llu,\"cmd\":\"%s\",\"seq\":%lld,%s}",
                                boot, (unsigned long long)now_us, verb, (long long)fetch.seq, fields);
    return fetch_take(&fetch, "reply/me", text, (size_t)length, now_us);
}

static void list(void) {
    must_ask("hello");
    (void)answer("\"ok\":true");
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

TEST(test_fetch_list_has_the_machines_recordings_and_no_other_names) {
    list();
    TEST_ASSERT_EQUAL_size_t(2, fetch.count);
    TEST_ASSERT_EQUAL_STRING("stop-000017-wheel_lost", fetch.list[1].name);
    TEST_ASSERT_FALSE(fetch.list[1].wall_us.known);
    TEST_ASSERT_FALSE(fetch.list[1].bytes[0].known);
    TEST_ASSERT_EQUAL_INT64(18, fetch.list[1].bytes[2].value);
    TEST_ASSERT_FALSE(step());
}

TEST(test_fetch_quotes_the_newest_answer_and_takes_piece_after_piece) {
    begin_fetching();
    now_us += 1000U;
    must_ask("recording");
    TEST_ASSERT_EQUAL_STRING("{\"from\":\"me\",\"seq\":3,\"boot\":\"aa\",\"t_us\":1000000000,"
                             "\"name\":\"stop-000017-wheel_lost.jsonl\",\"offset\":0}",
                             asked);
    TEST_ASSERT_EQUAL(FETCH_PIECE, answer("\"ok\":true,\"offset\":0,\"size\":9," DATA ",\"file_crc32\":3421780262"));
    TEST_ASSERT_EQUAL_size_t(1, fetch.got_file);
    TEST_ASSERT_EQUAL_MEMORY("123456789", fetch.bytes, 9);
    must_ask("recording");
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"t_us\":1000001000,\"name\":\"stop-000017-wheel_lost.log\",\"offset\":0}"));
    TEST_ASSERT_EQUAL(FETCH_PIECE, answer("\"ok\":true,\"offset\":0,\"size\":18," DATA ",\"file_crc32\":null"));
    TEST_ASSERT_EQUAL(FETCH_FETCHING, fetch.stage);
    must_ask("recording");
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"offset\":9}"));
    TEST_ASSERT_EQUAL(FETCH_PIECE, answer("\"ok\":true,\"offset\":9,\"size\":18," DATA ",\"file_crc32\":1266907876"));
    TEST_ASSERT_EQUAL(FETCH_DONE, fetch.stage);
    TEST_ASSERT_EQUAL_UINT64(0, fetch.again);
}

TEST(test_fetch_lost_answer_is_asked_again_with_a_new_time) {
    begin_fetching();
    must_ask("recording");
    now_us += 1999999U;
    TEST_ASSERT_FALSE(step());
    now_us++;
    must_ask("hello");
    (void)answer("\"ok\":true");
    must_ask("recording");
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"seq\":5,\"boot\":\"aa\",\"t_us\":1002000000,"));
    TEST_ASSERT_EQUAL(FETCH_PIECE, answer("\"ok\":true,\"offset\":0,\"size\":9," DATA ",\"file_crc32\":3421780262"));
    TEST_ASSERT_EQUAL_UINT64(1, fetch.again);
}

TEST(test_fetch_answer_that_comes_too_late_is_not_taken_for_a_later_one) {
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

TEST(test_fetch_bridge_that_began_anew_goes_on_where_it_was) {
    begin_fetching();
    must_ask("recording");
    (void)answer("\"ok\":true,\"offset\":0,\"size\":9," DATA ",\"file_crc32\":3421780262");
    must_ask("recording");
    (void)answer("\"ok\":true,\"offset\":0,\"size\":18," DATA ",\"file_crc32\":null");
    must_ask("recording");
    boot = "bb";
    (void)answer("\"ok\":false,\"error\":\"other_boot\",\"message\":\"quote the boot and t_us that are here\"");
    must_ask("recording");
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"boot\":\"bb\""));
    TEST_ASSERT_NOT_NULL(strstr(asked, "\"offset\":9}"));
    (void)answer("\"ok\":true,\"offset\":9,\"size\":18," DATA ",\"file_crc32\":1266907876");
    TEST_ASSERT_EQUAL(FETCH_DONE, fetch.stage);
}

TEST(test_fetch_machine_that_was_away_may_come_back_within_the_patience) {
    begin_fetching();
    (void)fetch_take(&fetch, "availability", "offline", 7, now_us);
    for (unsigned i = 0; i < 29U; i++) {
        TEST_ASSERT_TRUE(step());
        now_us += 2U * SECOND_US;
    }
    must_ask("hello");
    (void)answer("\"ok\":true");
    must_ask("recording");
    TEST_ASSERT_EQUAL(FETCH_PIECE, answer("\"ok\":true,\"offset\":0,\"size\":9," DATA ",\"file_crc32\":3421780262"));
}

TEST(test_fetch_machine_that_stays_away_is_given_up_with_the_reason) {
    begin_fetching();
    (void)fetch_take(&fetch, "availability", "offline", 7, now_us);
    now_us += PATIENCE_US;
    TEST_ASSERT_FALSE(step());
    TEST_ASSERT_EQUAL(FETCH_FAILED, fetch.stage);
    TEST_ASSERT_EQUAL_INT(75, fetch.code);
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "w1 has not answered for 60 s and is offline"));
}

TEST(test_fetch_machine_that_nobody_knows_is_given_up_soon) {
    must_ask("hello");
    now_us += 6U * SECOND_US;
    TEST_ASSERT_FALSE(step());
    TEST_ASSERT_EQUAL_INT(69, fetch.code);
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "no machine w1 is known"));
}

TEST(test_fetch_damaged_piece_is_asked_again_and_told_if_it_stays_so) {
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
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "stop-000017-wheel_lost.jsonl of w1 is not as its checksum says"));
}

TEST(test_fetch_file_that_is_not_whole_is_never_done) {
    begin_fetching();
    for (unsigned i = 0; i < 6U; i++) {
        must_ask("recording");
        TEST_ASSERT_EQUAL(FETCH_NOTHING, answer("\"ok\":true,\"offset\":0,\"size\":9," DATA ",\"file_crc32\":7"));
    }
    TEST_ASSERT_EQUAL(FETCH_FAILED, fetch.stage);
}

TEST(test_fetch_refusal_is_told_at_once_or_after_it_had_time_to_pass) {
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
            must_ask("hello");
            (void)answer("\"ok\":true");
            must_ask("recording");
        }
        (void)answer("\"ok\":false,\"error\":\"denied\",\"message\":\"still being read\"");
    }
    TEST_ASSERT_EQUAL_INT(1, fetch.code);
}

TEST(test_fetch_on_a_line_that_is_always_late_gives_up_and_says_so) {
    begin_fetching();
    unsigned sent = 0;
    while (fetch.stage == FETCH_FETCHING) {
        if (step()) {
            sent++;
            (void)answer((strcmp(verb, "hello") == 0)
                             ? "\"ok\":true"
                             : "\"ok\":false,\"error\":\"late\",\"message\":\"too long under way\"");
        }
        now_us += 50000U;
    }
    TEST_ASSERT_EQUAL_INT(75, fetch.code);
    TEST_ASSERT_NOT_NULL(strstr(fetch.why, "it said last: too long under way"));
    TEST_ASSERT_LESS_THAN_UINT(300, sent);
}

TEST(test_fetch_one_is_chosen_by_name_or_number) {
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

TEST(test_fetch_of_a_machine_without_recordings_says_why) {
    must_ask("hello");
    (void)answer("\"ok\":true");
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
