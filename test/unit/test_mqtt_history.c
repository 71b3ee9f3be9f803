// SPDX-License-Identifier: MIT
// The events that the stream has stored: each event once, with the gaps, in the requested span.
#include "history.h"

#include "iwheel_northbound/why.h"
#include "unit.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SECOND_US 1000000LL
/// Wall clock: 2026-11-21 22:00:00 UTC.
#define EVENING_US (1795298400LL * SECOND_US)

static history_t history;
static FILE *out;
static char *printed;
static size_t printed_size;

static void begin(history_config_t config) {
    out = open_memstream(&printed, &printed_size);
    config.since_us = (config.since_us > 0) ? config.since_us : EVENING_US;
    config.until_us = (config.until_us > 0) ? config.until_us : EVENING_US + 3600 * SECOND_US;
    TEST_ASSERT_TRUE(history_open(&history, &config, out));
    history.has_info = true;
}

void setUp(void) {
    TEST_ASSERT_EQUAL_INT(0, setenv("TZ", "UTC0", 1));
    tzset();
}

void tearDown(void) {
    history_close(&history);
    (void)fclose(out);
    free(printed);
}

static const char *text(void) {
    (void)fflush(out);
    return printed;
}

static void assert_printed(const char *words) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text(), words), printed);
}

/// Adds a stop of w1: boot, number of the event, number of the stop, seconds after EVENING_US of receipt and of
/// storage.
static void stop(const char *boot, int number, int stop_number, int received_s, int stored_s) {
    char payload[256];
    (void)snprintf(payload, sizeof payload,
                   "{\"id\":\"%s-%d\",\"boot\":\"%s\",\"heard_wall_us\":%lld,\"event\":\"stop\",\"number\":%d,"
                   "\"cause\":\"wheel_lost\",\"sentence\":\"stop number %d\"}",
                   boot, number, boot, (long long)(EVENING_US + received_s * SECOND_US), stop_number, stop_number);
    TEST_ASSERT_TRUE(
        history_take(&history, "iwheel/w1/event/stop", payload, strlen(payload), EVENING_US + stored_s * SECOND_US));
}

static void other(const char *name, const char *payload) {
    char topic[64];
    (void)snprintf(topic, sizeof topic, "iwheel/w1/event/%s", name);
    TEST_ASSERT_TRUE(history_take(&history, topic, payload, strlen(payload), EVENING_US + SECOND_US));
}

TEST(test_history_stop_is_one_line_with_time_and_sentence) {
    begin((history_config_t){0});
    stop("a", 1, 1, 61, 62);
    TEST_ASSERT_EQUAL_STRING("2026-11-21 22:01:01 w1           stop   stop number 1\n", text());
    history_sum(&history, "n1");
    assert_printed("1 stop of 1 machine, 2026-11-21 22:00:00 to 2026-11-21 23:00:00, from the stream at n1\n");
}

TEST(test_history_stop_has_the_longest_sentence) {
    char sentence[IWN_SENTENCE_SIZE];
    char payload[IWN_SENTENCE_SIZE + 128U];
    memset(sentence, 's', sizeof sentence);
    sentence[sizeof sentence - 1U] = '\0';
    (void)snprintf(payload, sizeof payload, "{\"id\":\"a-1\",\"event\":\"stop\",\"number\":1,\"sentence\":\"%s\"}",
                   sentence);
    begin((history_config_t){0});
    other("stop", payload);
    assert_printed(sentence);
}

TEST(test_history_doubles_are_dropped_across_bridge_restarts) {
    begin((history_config_t){0});
    stop("a", 1, 1, 1, 1);
    stop("a", 2, 2, 2, 2);
    stop("a", 1, 1, 1, 3);
    stop("b", 3, 3, 3, 4);
    stop("a", 2, 2, 2, 5);
    stop("b", 3, 3, 3, 6);
    stop("b", 4, 4, 4, 7);
    TEST_ASSERT_EQUAL_UINT64(4, history.printed);
    TEST_ASSERT_EQUAL_UINT64(3, history.doubled);
    TEST_ASSERT_EQUAL_UINT64(0, history.missing + history.stops_missing);
}

TEST(test_history_gap_in_numbers_is_printed_before_the_next_event) {
    begin((history_config_t){0});
    stop("a", 1, 1, 1, 1);
    stop("a", 5, 2, 2, 2);
    const char *note = strstr(text(), "-- 3 events before this one are not in the stream");
    TEST_ASSERT_NOT_NULL(note);
    TEST_ASSERT_NOT_NULL(strstr(note, "stop number 2"));
    TEST_ASSERT_NULL(strstr(printed, "stops before"));
    TEST_ASSERT_EQUAL_UINT64(3, history.missing);
}

TEST(test_history_gap_in_stops_is_printed_and_counts_from_restart) {
    begin((history_config_t){0});
    stop("a", 1, 7, 1, 1);
    stop("a", 2, 10, 2, 2);
    assert_printed("-- 2 stops before this one are not in the stream");
    stop("a", 3, 1, 3, 3);
    TEST_ASSERT_EQUAL_UINT64(2, history.stops_missing);
    stop("a", 4, 3, 4, 4);
    TEST_ASSERT_EQUAL_UINT64(3, history.stops_missing);
}

TEST(test_history_gap_among_hidden_events_is_printed_at_next_stop) {
    begin((history_config_t){0});
    stop("a", 1, 1, 1, 1);
    other("fault",
          "{\"id\":\"a-4\",\"heard_wall_us\":1795298401000000,\"event\":\"fault\",\"cause\":\"bus\",\"present\":true}");
    TEST_ASSERT_NULL(strstr(text(), "fault"));
    stop("a", 5, 2, 2, 2);
    assert_printed("-- 2 events before this one are not in the stream");
}

TEST(test_history_late_event_is_no_double_and_closes_its_gap) {
    begin((history_config_t){0});
    stop("a", 1, 1, 1, 1);
    stop("a", 5, 5, 2, 2);
    TEST_ASSERT_EQUAL_UINT64(3, history.missing);
    TEST_ASSERT_EQUAL_UINT64(3, history.stops_missing);
    stop("a", 3, 3, 1, 3);
    assert_printed("stop number 3");
    stop("a", 3, 3, 1, 3);
    TEST_ASSERT_EQUAL_UINT64(1, history.doubled);
    TEST_ASSERT_EQUAL_UINT64(2, history.missing);
    TEST_ASSERT_EQUAL_UINT64(2, history.stops_missing);
    stop("a", 2, 2, 1, 4);
    stop("a", 4, 4, 1, 4);
    stop("a", 6, 6, 5, 5);
    TEST_ASSERT_EQUAL_UINT64(0, history.missing + history.stops_missing);
    TEST_ASSERT_EQUAL_UINT64(6, history.printed);
}

/// Adds an info message: `last_stop` with its time in seconds after EVENING_US, and the counts of events.
static void info(const char *boot, int stop_number, int when_s, int last, int waiting, int dropped) {
    char payload[256];
    (void)snprintf(
        payload, sizeof payload,
        "{\"boot\":\"%s\",\"events\":{\"waiting\":%d,\"dropped\":%d,\"last\":%d},\"last_stop\":{\"number\":%d,"
        "\"wall_us\":%lld}}",
        boot, waiting, dropped, last, stop_number, (long long)(EVENING_US + when_s * SECOND_US));
    history_take_info(&history, "iwheel/w1/info", payload, strlen(payload));
}

TEST(test_history_gap_at_the_end_shows_by_info) {
    begin((history_config_t){0});
    info("a", 7, 30, 12, 0, 0);
    stop("a", 4, 4, 1, 1);
    history_end(&history);
    assert_printed("-- 3 stops after its last one here are not in the stream; its info names stop 7 "
                   "of 2026-11-21 22:00:30");
    assert_printed("-- 8 events after its last one here are not in the stream: the broker confirmed "
                   "them and did not store them; its spool dropped none");
    TEST_ASSERT_EQUAL_UINT64(3, history.stops_missing);
}

TEST(test_history_gap_without_any_event_shows_by_info) {
    begin((history_config_t){0});
    info("a", 7, 30, 12, 0, 0);
    history_end(&history);
    TEST_ASSERT_EQUAL_UINT64(1, history.stops_missing);
    tearDown();
    begin((history_config_t){0});
    info("a", 7, -30, 12, 0, 0);
    history_end(&history);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, history.stops_missing, "its last stop was before the span");
}

TEST(test_history_end_without_a_gap_prints_nothing) {
    begin((history_config_t){0});
    info("a", 4, 1, 6, 2, 0);
    stop("a", 4, 4, 1, 1);
    const size_t before = strlen(text());
    history_end(&history);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(before, strlen(text()), "two events wait at the machine");
}

TEST(test_history_with_an_unchecked_end_reports_it) {
    begin((history_config_t){0});
    history.has_info = false;
    history_end(&history);
    history_sum(&history, "n1");
    assert_printed("; its end is not checked");
}

TEST(test_history_gap_is_printed_with_its_cause) {
    begin((history_config_t){0});
    info("a", 4, 1, 9, 0, 5);
    stop("a", 1, 1, 1, 1);
    stop("a", 9, 2, 2, 2);
    assert_printed("its full spool dropped 5 events");
    tearDown();
    begin((history_config_t){0});
    stop("a", 1, 1, 1, 1);
    stop("a", 9, 2, 2, 2);
    assert_printed("dropped from its full spool, or confirmed by the broker and not stored");
}

TEST(test_history_all_has_other_events_and_bridge_restarts) {
    begin((history_config_t){.all = true});
    stop("a", 1, 1, 1, 1);
    other("fault",
          "{\"id\":\"b-2\",\"heard_wall_us\":1795298401000000,\"event\":\"fault\",\"cause\":\"bus\",\"present\":true}");
    assert_printed("w1           -- its bridge restarted: boot b\n");
    assert_printed("w1           fault  cause bus, present true\n");
}

TEST(test_history_span_accepts_either_clock_of_an_event) {
    begin((history_config_t){0});
    stop("a", 1, 1, -100, -90);
    stop("a", 2, 2, 3599, 9000);
    stop("a", 3, 3, -1000000, 10);
    stop("a", 4, 4, 1000000, 20);
    stop("a", 5, 5, 3600, 3601);
    TEST_ASSERT_EQUAL_UINT64(3, history.printed);
    assert_printed("stop number 2 (stored 2026-11-22 00:30:00)\n");
    assert_printed("stop number 3 (stored 2026-11-21 22:00:10)\n");
    assert_printed("stop number 4 (THE CLOCK OF THIS MACHINE IS WRONG: stored 2026-11-21 22:00:20)\n");
}

TEST(test_history_missed_stop_has_its_own_time_and_a_late_mark) {
    begin((history_config_t){0});
    other("stop", "{\"id\":\"a-1\",\"heard_wall_us\":1795302000000001,\"event\":\"stop\",\"missed\":true,\"number\":4,"
                  "\"cause\":\"wheel_lost\",\"wall_us\":1795298460000000,\"sentence\":\"gone\"}");
    assert_printed("2026-11-21 22:01:00 w1           stop   gone (reported late: its bridge did not run)");
}

TEST(test_history_json_nests_the_message_and_ends_with_the_sum) {
    begin((history_config_t){.json = true});
    stop("a", 1, 1, 1, 2);
    stop("b", 4, 4, 2, 3);
    history_sum(&history, "n1");
    assert_printed("{\"machine\":\"w1\",\"wall_us\":1795298401000000,\"stored_wall_us\":1795298402000000,"
                   "\"missing_before\":0,\"stops_missing_before\":0,\"bridge_began_anew\":false,"
                   "\"message\":{\"id\":\"a-1\"");
    assert_printed("\"missing_before\":2,\"stops_missing_before\":2,\"bridge_began_anew\":true");
    assert_printed("{\"events\":2,\"machines\":1,\"doubled\":0,\"garbled\":0,\"missing\":2,");
}

TEST(test_history_garbage_is_counted_and_prints_no_escape) {
    begin((history_config_t){.all = true});
    other("stop", "{");
    other("stop", "[]");
    other("stop", "");
    TEST_ASSERT_TRUE(history_take(&history, "iwheel/w1/state", "{}", 2, EVENING_US));
    TEST_ASSERT_TRUE(history_take(&history, "iwheel/w1/event/a b", "{}", 2, EVENING_US));
    TEST_ASSERT_EQUAL_UINT64(5, history.garbled);
    other("stop", "{\"id\":\"-\",\"sentence\":\"\\u001b[2J\"}");
    other("fault", "{\"id\":7,\"cause\":\"\\u001b[2J\",\"present\":[\"\\u001b\"]}");
    TEST_ASSERT_EQUAL_UINT64(2, history.printed);
    TEST_ASSERT_NULL(strchr(text(), '\033'));
}

TEST(test_history_ends_when_its_output_fails) {
    begin((history_config_t){0});
    FILE *full = fopen("/dev/full", "w");
    TEST_ASSERT_NOT_NULL(full);
    (void)setvbuf(full, NULL, _IONBF, 0);
    FILE *saved = history.out;
    history.out = full;
    static const char payload[] = "{\"id\":\"a-1\",\"heard_wall_us\":1795298401000000}";
    TEST_ASSERT_FALSE(history_take(&history, "iwheel/w1/event/stop", payload, sizeof payload - 1U, EVENING_US));
    history.out = saved;
    (void)fclose(full);
}

TEST(test_history_times_and_spans_are_parsed_strictly) {
    int64_t us = 0;
    begin((history_config_t){0});
    static const char *const good[] = {"2026-11-21T22:00:00", "2026-11-21 22:00", "2026-11-21T22:00",
                                       "2026-11-21T22:00Z"};
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(history_when(good[i], &us), good[i]);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(EVENING_US, us, good[i]);
    }
    TEST_ASSERT_TRUE(history_when("2026-11-21", &us));
    TEST_ASSERT_EQUAL_INT64(EVENING_US - 22 * 3600 * SECOND_US, us);
    TEST_ASSERT_EQUAL_INT(0, setenv("TZ", "CET-1", 1));
    tzset();
    TEST_ASSERT_TRUE(history_when("2026-11-21T23:00", &us));
    TEST_ASSERT_EQUAL_INT64(EVENING_US, us);
    static const char *const bad[] = {"",           "22:00",      "2026-11-21T", "2026-11-21T22:00x",
                                      "2026-02-30", "2026-13-01", "yesterday"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(history_when(bad[i], &us), bad[i]);
    }
    TEST_ASSERT_TRUE(history_span("12h", &us));
    TEST_ASSERT_EQUAL_INT64(43200 * SECOND_US, us);
    TEST_ASSERT_TRUE(history_span("7d", &us));
    TEST_ASSERT_TRUE(history_span("90min", &us));
    TEST_ASSERT_FALSE(history_span("12", &us));
    TEST_ASSERT_FALSE(history_span("0h", &us));
    TEST_ASSERT_FALSE(history_span("-1h", &us));
    TEST_ASSERT_FALSE(history_span("h", &us));
}
