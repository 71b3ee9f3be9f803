// SPDX-License-Identifier: MIT
// The recording on request: its limits, its place next to recordings of stops, and its end.
#include "box/box.h"
#include "disk/box_files.h"
#include "disk/box_writer.h"
#include "sockets/log.h"

#include "iwheel_linux/clock.h"

#include "box_end.h"
#include "folder.h"
#include "unit.h"
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#define CONFIG "[record]\nblackbox_s = 2\n"

static gw_box_t box;
static char records[96];
static sock_log_t log_;
static iw_time_us_t now_us;

void setUp(void) {
    folder_make();
    (void)snprintf(records, sizeof records, "%s/records", folder);
    const gw_box_config_t wanted = {
        .blackbox_s = 2, .keep_stops = 3, .directory = records, .bus = "can0", .estop = "none", .config = CONFIG};
    TEST_ASSERT_EQUAL(0, gw_box_open(&box, &wanted));
    sock_log_open(&log_, SOCK_LOG_ERROR);
    now_us = iwl_clock_now_us();
}

void tearDown(void) {
    box_end(&box);
    sock_log_close(&log_);
    folder_remove();
}

static void wait_result(void) {
    struct pollfd entry = {.fd = box.writer.fd, .events = POLLIN};
    TEST_ASSERT_EQUAL(1, poll(&entry, 1, 10000));
    gw_record_take(&box, &log_);
}

static void begin(void) {
    now_us += GW_RECORD_AGAIN_US;
    TEST_ASSERT_NULL(gw_record_request(&box, true, "client 3", now_us));
    wait_result();
    TEST_ASSERT_EQUAL_INT(GW_BOX_RUNS, box.request.ended);
    TEST_ASSERT_TRUE(box.request.on);
}

static void end(void) {
    TEST_ASSERT_NULL(gw_record_request(&box, false, "client 3", now_us));
    TEST_ASSERT_FALSE(box.request.on);
    wait_result();
    TEST_ASSERT_EQUAL_INT(GW_BOX_BY_REQUEST, box.request.ended);
}

static void put_frame(uint8_t value) {
    const blackbox_entry_t frame = {.at_us = iwl_clock_now_us(),
                                    .kind = BLACKBOX_FRAME,
                                    .number = IW_ID_LEFT_SPEED,
                                    .a = 4,
                                    .as = {.data = {0, value}}};
    blackbox_ring_put(box.ring, &frame);
}

/// Orders the recording of a stop in motion, and waits for its result.
static void stop(uint32_t number) {
    gw_box_order_t order = {.cause = "wheel_lost", .from = "armed", .mark = blackbox_ring_written(box.ring)};
    order.note.stop.number = number;
    order.note.stop.at_us = iwl_clock_now_us() - GW_BOX_AFTER_US;
    order.note.stop.applied.wheel[IW_LEFT].speed_mm_s = 300;
    TEST_ASSERT_TRUE(gw_box_write(&box, &order));
    wait_result();
    TEST_ASSERT_EQUAL_UINT32(number, box.stop.number);
    TEST_ASSERT_EQUAL_INT(0, box.stop.error);
}

static char *in_records(const char *name) {
    static char path[192];
    (void)snprintf(path, sizeof path, "%s/%s", records, name);
    return path;
}

static const char *read_file(const char *name) {
    return file_text(in_records(name));
}

static bool is_there(const char *name) {
    return file_exists(in_records(name));
}

static void assert_has(const char *text, const char *part) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, part), text);
}

TEST(test_request_records_from_its_begin_to_its_end) {
    put_frame(1);
    begin();
    TEST_ASSERT_EQUAL_STRING("stop-000001-requested", box.request.name);
    put_frame(2);
    (void)usleep(300000);
    put_frame(3);
    end();
    put_frame(4);
    const char *text = read_file("stop-000001-requested.log");
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "100#00010000"), "a frame from before the request");
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "100#00040000"), "a frame from after the end");
    assert_has(text, ") can0 100#00020000 R\n");
    assert_has(text, ") can0 100#00030000 R\n");
    text = read_file("stop-000001-requested.jsonl");
    assert_has(text, "\"cause\":\"requested\"");
    assert_has(text, "\"in_motion\":false");
    assert_has(text, "recorded on request of client 3; it is no stop");
    assert_has(text, "{\"type\":\"end\",\"frames\":2}\n");
    TEST_ASSERT_EQUAL_STRING(CONFIG, read_file("stop-000001-requested.conf"));
}

TEST(test_request_is_described_with_its_limits) {
    char text[512];
    iwn_out_t json;
    begin();
    end();
    iwn_out_init(&json, text, sizeof text);
    gw_record_write_request(&box, &json);
    TEST_ASSERT_GREATER_THAN(0, iwn_out_finish(&json));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"on\":false,"), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"ended\":\"request\","), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"fault\":null,"), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"most_ms\":600000,"), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"most_bytes\":16777216"), text);
}

TEST(test_request_is_on_the_disk_while_it_runs) {
    begin();
    put_frame(2);
    for (unsigned i = 0; i < 100U && strstr(read_file("stop-000001-requested.log"), "100#00020000") == NULL; i++) {
        (void)usleep(100000);
    }
    assert_has(read_file("stop-000001-requested.log"), "100#00020000");
    end();
}

TEST(test_request_for_the_present_state_changes_nothing) {
    TEST_ASSERT_NULL(gw_record_request(&box, false, "client 3", now_us));
    begin();
    TEST_ASSERT_NULL(gw_record_request(&box, true, "client 4", now_us));
    TEST_ASSERT_EQUAL_UINT32(1, box.request.number);
    end();
    TEST_ASSERT_FALSE(is_there("stop-000002-requested.conf"));
}

TEST(test_request_too_soon_after_the_last_is_refused) {
    begin();
    end();
    const char *why = gw_record_request(&box, true, "client 3", now_us + GW_RECORD_AGAIN_US - 1U);
    TEST_ASSERT_NOT_NULL(why);
    assert_has(why, "less than 2 s ago");
    TEST_ASSERT_FALSE(box.request.on);
}

/// The newest requests stay. A recording of a stop is never removed for one.
TEST(test_requests_remove_only_older_requests) {
    stop(1);
    for (unsigned i = 0; i < 4U; i++) {
        begin();
        end();
    }
    TEST_ASSERT_TRUE(is_there("stop-000001-wheel_lost.log"));
    TEST_ASSERT_FALSE(is_there("stop-000002-requested.log"));
    TEST_ASSERT_FALSE(is_there("stop-000002-requested.conf"));
    TEST_ASSERT_TRUE(is_there("stop-000003-requested.log"));
    TEST_ASSERT_TRUE(is_there("stop-000005-requested.log"));
}

/// More stops than `keep_stops` while a request runs: its files stay, those of an ended one would not.
TEST(test_stop_during_a_request_is_recorded_and_spares_it) {
    begin();
    put_frame(7);
    for (unsigned number = 1; number <= 4U; number++) {
        stop(number);
    }
    TEST_ASSERT_TRUE(is_there("stop-000005-wheel_lost.log"));
    TEST_ASSERT_TRUE(is_there("stop-000001-requested.log"));
    put_frame(8);
    end();
    assert_has(read_file("stop-000001-requested.log"), "100#00080000");
    stop(5);
    TEST_ASSERT_FALSE(is_there("stop-000001-requested.log"));
}

TEST(test_request_ends_with_the_gateway) {
    begin();
    put_frame(9);
    box_end(&box);
    assert_has(read_file("stop-000001-requested.jsonl"), "{\"type\":\"end\",\"frames\":1}\n");
}

TEST(test_request_without_a_directory_reports_the_fault) {
    box_end(&box);
    (void)snprintf(records, sizeof records, "%s/no/such/folder", folder);
    const gw_box_config_t wanted = {
        .blackbox_s = 2, .keep_stops = 3, .directory = records, .bus = "can0", .estop = "none", .config = CONFIG};
    TEST_ASSERT_EQUAL(0, gw_box_open(&box, &wanted));
    wait_result(); // The directory.
    TEST_ASSERT_NULL(gw_record_request(&box, true, "client 3", now_us));
    wait_result();
    TEST_ASSERT_FALSE(box.request.on);
    TEST_ASSERT_EQUAL_INT(GW_BOX_BY_FAULT, box.request.ended);
    TEST_ASSERT_EQUAL_INT(ENOENT, box.request.error);
}

TEST(test_request_of_a_killed_writer_has_ended) {
    begin();
    TEST_ASSERT_EQUAL(0, kill(box.writer.pid, SIGKILL));
    wait_result();
    TEST_ASSERT_FALSE(box.request.on);
    TEST_ASSERT_EQUAL_INT(GW_BOX_BY_FAULT, box.request.ended);
}

TEST(test_result_of_an_earlier_request_changes_nothing) {
    begin();
    const int real = box.writer.fd;
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends));
    const gw_box_result_t late = {.kind = GW_BOX_END, .ended = GW_BOX_BY_SIZE, .number = 7};
    TEST_ASSERT_EQUAL((ssize_t)sizeof late, send(ends[1], &late, sizeof late, 0));
    box.writer.fd = ends[0];
    wait_result();
    box.writer.fd = real;
    TEST_ASSERT_TRUE(box.request.on);
    (void)close(ends[0]);
    (void)close(ends[1]);
}

/// A writer in this process: the limits without ten minutes and 16 MiB.
static gw_writer_t request;
static gw_box_result_t result;

static void run_request(iw_time_us_t begun_us, uint64_t most_bytes, unsigned frames) {
    static blackbox_entry_t copy[8192];
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends));
    TEST_ASSERT_LESS_OR_EQUAL(sizeof copy / sizeof copy[0], blackbox_ring_most(box.ring));
    request = (gw_writer_t){.fd = ends[0], .ring = box.ring, .config = &box.config, .copy = copy, .bus = "can0"};
    const gw_box_order_t order = {
        .cause = GW_BOX_REQUESTED, .from = "listening", .note = {.stop = {.number = 1, .at_us = begun_us}}};
    gw_request_begin(&request, &order);
    TEST_ASSERT_TRUE(gw_request_runs(&request));
    TEST_ASSERT_EQUAL((ssize_t)sizeof result, recv(ends[1], &result, sizeof result, 0));
    TEST_ASSERT_EQUAL_UINT64(GW_BOX_REQUEST_BYTES, request.most_bytes);
    request.most_bytes = most_bytes;
    for (unsigned i = 0; i < frames; i++) {
        put_frame(1);
    }
    gw_request_step(&request);
    result = (gw_box_result_t){.ended = GW_BOX_RUNS};
    (void)recv(ends[1], &result, sizeof result, MSG_DONTWAIT);
    gw_request_end(&request, GW_BOX_BY_REQUEST);
    (void)close(ends[0]);
    (void)close(ends[1]);
}

TEST(test_request_ends_at_its_size) {
    run_request(now_us, 4096, 500);
    TEST_ASSERT_EQUAL_INT(GW_BOX_BY_SIZE, result.ended);
    struct stat status;
    char path[192];
    (void)snprintf(path, sizeof path, "%s/stop-000001-requested.log", records);
    TEST_ASSERT_EQUAL_INT(0, stat(path, &status));
    TEST_ASSERT_LESS_THAN(4096 + 200, status.st_size);
}

TEST(test_request_ends_after_its_time) {
    run_request(now_us - GW_BOX_REQUEST_US + 60000000U, UINT64_MAX, 3);
    TEST_ASSERT_EQUAL_INT(GW_BOX_RUNS, result.ended);
    run_request(now_us - GW_BOX_REQUEST_US, UINT64_MAX, 3);
    TEST_ASSERT_EQUAL_INT(GW_BOX_BY_TIME, result.ended);
}

TEST(test_failed_write_ends_the_request_without_last_line) {
    run_request(now_us, UINT64_MAX, 0);
    TEST_ASSERT_EQUAL_INT(GW_BOX_RUNS, result.ended);
    const gw_box_order_t order = {.cause = GW_BOX_REQUESTED, .note = {.stop = {.number = 2, .at_us = now_us}}};
    gw_request_begin(&request, &order);
    (void)fclose(request.frames_file);
    request.frames_file = fopen("/dev/full", "w");
    put_frame(1);
    gw_request_step(&request);
    TEST_ASSERT_FALSE(gw_request_runs(&request));
    TEST_ASSERT_EQUAL_INT(ENOSPC, request.error);
    TEST_ASSERT_NULL(strstr(read_file("stop-000002-requested.jsonl"), "\"end\""));
}
