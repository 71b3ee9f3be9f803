// SPDX-License-Identifier: MIT
#include "box/box.h"
#include "config/gateway_config.h"
#include "disk/box_files.h"
#include "sockets/log.h"

#include "iwheel_linux/clock.h"

#include "box_end.h"
#include "folder.h"
#include "unit.h"
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#define CONFIG "[record]\nblackbox_s = 2\n"

static gateway_config_t config;
static gw_box_t box;
static bool open_box;

static off_t *synced; ///< Bytes of all files at their last fsync, in memory that the writer process shares.

/// Succeeds and sets errno, as any call may do.
int fsync(int fd) {
    struct stat status;
    if (synced != NULL && fstat(fd, &status) == 0 && S_ISREG(status.st_mode)) {
        *synced += status.st_size;
    }
    errno = (fd >= 0) ? ENOSPC : EBADF;
    return (fd >= 0) ? 0 : -1;
}

void setUp(void) {
    gateway_config_default(&config);
    folder_make();
    (void)snprintf(config.record.directory, sizeof config.record.directory, "%s/records", folder);
    config.record.blackbox_s = 2;
    config.record.keep_stops = 8;
}

void tearDown(void) {
    if (open_box) {
        box_end(&box);
        open_box = false;
    }
    (void)umount2(config.record.directory, MNT_DETACH);
    folder_remove();
}

/// Opens the box as from a terminal, independent of the parent process.
static void start(void) {
    (void)signal(SIGINT, SIG_DFL);
    const gw_box_config_t wanted = {.blackbox_s = config.record.blackbox_s,
                                    .keep_stops = config.record.keep_stops,
                                    .directory = config.record.directory,
                                    .bus = config.bus.interface,
                                    .estop = config.estop.line,
                                    .config = CONFIG};
    TEST_ASSERT_EQUAL(0, gw_box_open(&box, &wanted));
    open_box = true;
}

static gw_child_news_t wait_news(void) {
    struct pollfd entry = {.fd = box.writer.fd, .events = POLLIN};
    TEST_ASSERT_EQUAL(1, poll(&entry, 1, 10000));
    return gw_box_take(&box);
}

/// Adds ten frames and ten steps of the last second, and returns the order of a stop that has ended.
static gw_box_order_t stopped(const char *cause) {
    const iw_time_us_t now_us = iwl_clock_now_us();
    const iw_time_us_t stop_us = now_us - GW_BOX_AFTER_US;
    for (unsigned i = 0; i < 10U; i++) {
        const blackbox_entry_t frame = {.at_us = stop_us - 1000U + i,
                                        .kind = BLACKBOX_FRAME,
                                        .number = 256,
                                        .a = 4,
                                        .as = {.data = {0, (uint8_t)i}}};
        const blackbox_entry_t step = {.at_us = stop_us - 1000U + i, .kind = BLACKBOX_STEP};
        blackbox_ring_put(box.ring, &frame);
        blackbox_ring_put(box.ring, &step);
    }
    gw_box_order_t order = {.note = {.stop = {.number = 3, .at_us = stop_us, .cause = IW_CAUSE_ESTOP_LINE}},
                            .from = "armed",
                            .wall_minus_us = 1000,
                            .mark = blackbox_ring_written(box.ring)};
    (void)snprintf(order.cause, sizeof order.cause, "%s", cause);
    (void)snprintf(order.note.sentence, sizeof order.note.sentence, "because of \"this\"");
    return order;
}

static void record_order(const gw_box_order_t *order, int error) {
    TEST_ASSERT_TRUE(gw_box_write(&box, order));
    TEST_ASSERT_EQUAL(GW_CHILD_MESSAGE, wait_news());
    TEST_ASSERT_EQUAL(3, box.last.number);
    TEST_ASSERT_EQUAL(error, box.last.error);
}

static void record(const char *cause, int error) {
    const gw_box_order_t order = stopped(cause);
    record_order(&order, error);
}

/// Records a stop while the wheels were commanded.
static void record_in_motion(const char *cause, int error) {
    gw_box_order_t order = stopped(cause);
    order.note.stop.applied.wheel[IW_RIGHT].speed_mm_s = -400;
    record_order(&order, error);
}

/// Records a stop with both wheels at standstill; the recording may fail.
static void record_harmless(const char *cause) {
    gw_box_order_t order = stopped(cause);
    const blackbox_entry_t rest = {
        .at_us = order.note.stop.at_us - 1U, .kind = BLACKBOX_FRAME, .number = IW_ID_LEFT_SPEED, .a = 4};
    blackbox_ring_put(box.ring, &rest);
    order.mark = blackbox_ring_written(box.ring);
    TEST_ASSERT_TRUE(gw_box_write(&box, &order));
    TEST_ASSERT_EQUAL(GW_CHILD_MESSAGE, wait_news());
}

static char *in_records(const char *name) {
    static char path[256];
    (void)snprintf(path, sizeof path, "%s/%s", config.record.directory, name);
    return path;
}

static bool is_there(const char *name) {
    return file_exists(in_records(name));
}

static unsigned count_files(void) {
    return files_in(config.record.directory, "stop-");
}

static const char *read_file(const char *name) {
    return file_text(in_records(name));
}

TEST(test_recording_has_frames_events_and_configuration) {
    start();
    record("estop_line", 0);
    TEST_ASSERT_EQUAL(10, box.last.frames);
    TEST_ASSERT_NOT_NULL(strstr(box.last.path, "/records/stop-000001-estop_line.log"));
    TEST_ASSERT_EQUAL(3, count_files());
    const char *text = read_file("stop-000001-estop_line.log");
    TEST_ASSERT_NOT_NULL(strstr(text, ") can0 100#00000000 R\n"));
    TEST_ASSERT_NOT_NULL(strstr(text, ") can0 100#00090000 R\n"));
    text = read_file("stop-000001-estop_line.jsonl");
    TEST_ASSERT_NOT_NULL(strstr(text, "{\"type\":\"blackbox\",\"format\":1,"));
    TEST_ASSERT_NOT_NULL(strstr(text, "\"sentence\":\"because of \\\"this\\\"\""));
    TEST_ASSERT_NOT_NULL(strstr(text, "{\"type\":\"step\",\"frames\":10,"));
    TEST_ASSERT_NOT_NULL(strstr(text, "{\"type\":\"end\",\"frames\":10}\n"));
    TEST_ASSERT_NULL(strstr(text, "lost"));
    text = read_file("stop-000001-estop_line.conf");
    TEST_ASSERT_EQUAL_STRING(CONFIG, text);
}

TEST(test_recording_has_wall_clock_times) {
    char line[64];
    start();
    const gw_box_order_t order = stopped("estop_line");
    record_order(&order, 0);
    const uint64_t first_us = order.note.stop.at_us - 1000U + (uint64_t)order.wall_minus_us;
    (void)snprintf(line, sizeof line, "(%llu.%06llu) can0 100#00000000 R\n", (unsigned long long)first_us / 1000000U,
                   (unsigned long long)first_us % 1000000U);
    const char *text = read_file("stop-000001-estop_line.log");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, line), text);
}

TEST(test_recording_is_on_the_disk_to_its_last_byte) {
    static const char *const names[] = {"stop-000001-estop_line.log", "stop-000001-estop_line.jsonl",
                                        "stop-000001-estop_line.conf"};
    off_t bytes = 0;
    synced = mmap(NULL, sizeof *synced, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    TEST_ASSERT_TRUE(synced != MAP_FAILED);
    start();
    record("estop_line", 0);
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const char *text = read_file(names[i]);
        bytes += (off_t)strlen(text);
    }
    TEST_ASSERT_EQUAL_INT(bytes, *synced);
    (void)munmap(synced, sizeof *synced);
    synced = NULL;
}

TEST(test_recording_contains_entries_after_the_stop) {
    start();
    const gw_box_order_t order = stopped("estop_line");
    const blackbox_entry_t frame = {
        .at_us = order.note.stop.at_us + 1000U, .kind = BLACKBOX_FRAME, .number = 257, .a = 4};
    const blackbox_entry_t state = {.at_us = order.note.stop.at_us + 2000U,
                                    .kind = BLACKBOX_STATE,
                                    .number = 5,
                                    .a = IW_STATE_LATCHED,
                                    .b = IW_STATE_ARMED,
                                    .as = {.drive = {.speed_mm_s = {12, -34}}}};
    blackbox_ring_put(box.ring, &frame);
    blackbox_ring_put(box.ring, &state);
    TEST_ASSERT_TRUE(gw_box_write(&box, &order));
    TEST_ASSERT_EQUAL(GW_CHILD_MESSAGE, wait_news());
    TEST_ASSERT_EQUAL(11, box.last.frames);
    const char *text = read_file("stop-000001-estop_line.jsonl");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"bus\":\"can0\""), text);
    const char *line = strstr(text, "{\"type\":\"state\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(line, text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line, "\"state\":\"latched\""), line);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line, "\"applied_left_mm_s\":12,"), line);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line, "\"applied_right_mm_s\":-34"), line);
}

TEST(test_recording_excludes_entries_older_than_blackbox_s) {
    start();
    const blackbox_entry_t old = {.at_us = 1, .kind = BLACKBOX_FRAME, .number = 0x7FF};
    blackbox_ring_put(box.ring, &old);
    record("estop_line", 0);
    TEST_ASSERT_EQUAL(10, box.last.frames);
}

TEST(test_recording_of_an_overwritten_ring_is_not_from_start) {
    start();
    record("estop_line", 0);
    const char *text = read_file("stop-000001-estop_line.jsonl");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"from_start\":true"), text);
    for (iw_time_us_t at_us = iwl_clock_now_us() - GW_BOX_AFTER_US - 1000000U; blackbox_ring_is_whole(box.ring);) {
        const blackbox_entry_t step = {.at_us = at_us, .kind = BLACKBOX_STEP};
        blackbox_ring_put(box.ring, &step);
    }
    record("estop_line", 0);
    text = read_file("stop-000002-estop_line.jsonl");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"from_start\":false"), text);
}

/// The standard streams and its end of the socket.
TEST(test_writer_has_no_open_file_after_a_recording) {
    char path[64];
    start();
    record("estop_line", 0);
    (void)snprintf(path, sizeof path, "/proc/%d/fd", (int)box.writer.pid);
    TEST_ASSERT_EQUAL_UINT(4U, files_in(path, ""));
}

TEST(test_recording_number_continues_after_a_restart) {
    start();
    record("wheel_lost", 0);
    box_end(&box);
    start();
    record("bus_down", 0);
    TEST_ASSERT_NOT_NULL(strstr(box.last.path, "stop-000002-bus_down.log"));
}

TEST(test_many_stops_retain_the_newest_and_other_files) {
    start();
    record("estop_line", 0);
    file_put(in_records("stop-me.txt"), "", 0);
    for (unsigned i = 0; i < config.record.keep_stops + 2U; i++) {
        record("estop_line", 0);
    }
    TEST_ASSERT_EQUAL(3U * config.record.keep_stops + 1U, count_files());
    TEST_ASSERT_TRUE(is_there("stop-me.txt"));
    TEST_ASSERT_FALSE(is_there("stop-000003-estop_line.log"));
    TEST_ASSERT_TRUE(is_there("stop-000004-estop_line.log"));
}

TEST(test_harmless_stops_do_not_replace_recordings_of_motion) {
    start();
    record_in_motion("wheel_lost", 0);
    for (unsigned i = 0; i < 40U; i++) {
        record_harmless("estop_software");
    }
    TEST_ASSERT_TRUE(is_there("stop-000001-wheel_lost.log"));
    TEST_ASSERT_EQUAL(3U * config.record.keep_stops, count_files());
    for (unsigned i = 0; i < config.record.keep_stops; i++) {
        record_in_motion("bus_down", 0);
    }
    TEST_ASSERT_FALSE(is_there("stop-000001-wheel_lost.log")); // It is the oldest of its kind.
    record_harmless("estop_software");                         // The newest stays and replaces none of them.
    record_harmless("estop_software");
    TEST_ASSERT_FALSE(is_there("stop-000050-estop_software.log"));
    TEST_ASSERT_TRUE(is_there("stop-000051-estop_software.log"));
    TEST_ASSERT_EQUAL(3U * (config.record.keep_stops + 1U), count_files());
}

TEST(test_recording_of_an_uncommanded_turning_wheel_is_motion) {
    start();
    gw_box_order_t order = stopped("estop_line");
    const blackbox_entry_t turning = {.at_us = order.note.stop.at_us - 1U,
                                      .kind = BLACKBOX_FRAME,
                                      .number = IW_ID_RIGHT_SPEED,
                                      .a = 4,
                                      .as = {.data = {0xFF, 0xF0}}};
    blackbox_ring_put(box.ring, &turning);
    order.mark = blackbox_ring_written(box.ring);
    record_order(&order, 0);
    const char *text = read_file("stop-000001-estop_line.jsonl");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"in_motion\":true"), text);
    TEST_ASSERT_FALSE(gw_box_line_is_harmless(text));
}

TEST(test_recording_of_an_old_version_is_judged_by_its_command) {
    const char *head = "{\"type\":\"blackbox\"}\n{\"type\":\"why\",";
    char lines[256];
    const struct {
        const char *fields;
        bool harmless;
    } rows[] = {{"\"applied_left_mm_s\":0,\"applied_right_mm_s\":0,\"at_us\":1}\n", true},
                {"\"applied_left_mm_s\":0,\"applied_right_mm_s\":1,\"at_us\":1}\n", false},
                {"\"applied_left_mm_s\":-1,\"applied_right_mm_s\":0,\"at_us\":1}\n", false},
                {"\"in_motion\":true,\"applied_left_mm_s\":0,\"applied_right_mm_s\":0,\"at_us\":1}\n", false},
                {"\"in_motion\":false,\"applied_left_mm_s\":0,\"applied_right_mm_s\":0,\"at_us\":1}\n", true},
                {"", false}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        (void)snprintf(lines, sizeof lines, "%s%s", head, rows[i].fields);
        TEST_ASSERT_EQUAL_MESSAGE(rows[i].harmless, gw_box_line_is_harmless(lines), lines);
    }
    TEST_ASSERT_FALSE(gw_box_line_is_harmless(""));
}

/// Mounts a small disk. Requires the right to mount.
static bool mount_small_disk(void) {
    (void)mkdir(config.record.directory, 0755);
    return mount("none", config.record.directory, "tmpfs", 0, "size=1536k,mode=0755") == 0;
}

/// Fills the disk to its last byte, as any local user can do.
static void fill_disk(const char *name) {
    static const char block[4096];
    FILE *file = fopen(in_records(name), "w");
    TEST_ASSERT_NOT_NULL(file);
    while (fwrite(block, 1, sizeof block, file) == sizeof block && fflush(file) == 0) {
    }
    (void)fclose(file);
}

TEST(test_full_disk_drops_harmless_recordings_first) {
    if (!mount_small_disk()) {
        TEST_IGNORE_MESSAGE("mounting a tmpfs is not permitted");
    }
    start();
    record_in_motion("wheel_lost", 0);
    for (unsigned i = 0; i < 4U; i++) {
        record_harmless("estop_software");
    }
    TEST_ASSERT_TRUE(is_there("reserve"));
    fill_disk("strangers");
    record_in_motion("bus_down", 0); // The reserve has the space.
    TEST_ASSERT_TRUE(is_there("stop-000006-bus_down.jsonl"));
    fill_disk("strangers2");
    record_in_motion("echo_lost", 0);
    TEST_ASSERT_TRUE(is_there("stop-000001-wheel_lost.log"));
    TEST_ASSERT_TRUE(is_there("stop-000006-bus_down.log"));
    TEST_ASSERT_TRUE(is_there("stop-000007-echo_lost.log"));
    fill_disk("strangers3");
    while (box.last.error == 0) { // Harmless ones replace each other, then fail: no other is replaced.
        fill_disk("strangers4");
        record_harmless("estop_software");
        TEST_ASSERT_TRUE(is_there("stop-000007-echo_lost.log"));
    }
    TEST_ASSERT_EQUAL(ENOSPC, box.last.error);
    TEST_ASSERT_TRUE(is_there("stop-000001-wheel_lost.log"));
    TEST_ASSERT_TRUE(is_there("stop-000006-bus_down.log"));
}

TEST(test_missing_directory_is_reported_at_start_and_each_stop) {
    (void)snprintf(config.record.directory, sizeof config.record.directory, "%s/no/such/folder", folder);
    start();
    TEST_ASSERT_EQUAL(GW_CHILD_MESSAGE, wait_news());
    TEST_ASSERT_EQUAL(0, box.last.number);
    TEST_ASSERT_EQUAL(ENOENT, box.last.error);
    record("estop_line", ENOENT);
}

/// Writes the log lines of the next result to `text`.
static void line(const char *cause, char *text, size_t size) {
    FILE *file = tmpfile();
    sock_log_t log = {.program = "test", .credit = 10, .fd = fileno(file), .level = SOCK_LOG_INFO};
    struct pollfd entry = {.fd = box.writer.fd, .events = POLLIN};
    if (cause != NULL) {
        const gw_box_order_t order = stopped(cause);
        TEST_ASSERT_TRUE(gw_box_write(&box, &order));
    }
    TEST_ASSERT_EQUAL(1, poll(&entry, 1, 10000));
    gw_record_take(&box, &log);
    rewind(file);
    text[fread(text, 1, size - 1U, file)] = '\0';
    (void)fclose(file);
}

TEST(test_result_of_a_recording_is_logged) {
    char text[1024];
    start();
    line("estop_line", text, sizeof text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "stop 3 is recorded in "), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "stop-000001-estop_line.log (10 frames, "), text);
    box_end(&box);
    (void)snprintf(config.record.directory, sizeof config.record.directory, "%s/no/such/folder", folder);
    start();
    line(NULL, text, sizeof text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "no recording can be written to "), text);
    line("estop_line", text, sizeof text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "stop 3 is not recorded in "), text);
}

TEST(test_directory_that_appears_later_is_used) {
    char command[160];
    (void)snprintf(config.record.directory, sizeof config.record.directory, "%s/no/folder", folder);
    start();
    TEST_ASSERT_EQUAL(GW_CHILD_MESSAGE, wait_news());
    (void)snprintf(command, sizeof command, "mkdir %s/no", folder);
    TEST_ASSERT_EQUAL(0, system(command));
    record("estop_line", 0);
}

TEST(test_oldest_recording_is_dropped_only_below_the_number) {
    start();
    record("a", 0);
    record("b", 0);
    const int directory = gw_box_files_open(config.record.directory);
    TEST_ASSERT_TRUE(gw_box_files_drop_oldest(directory, &(gw_box_limits_t){.below = 2, .in_motion = true}));
    TEST_ASSERT_FALSE(gw_box_files_drop_oldest(directory, &(gw_box_limits_t){.below = 2, .in_motion = true}));
    TEST_ASSERT_EQUAL(3, count_files());
    TEST_ASSERT_EQUAL(3, gw_box_files_next(directory));
    gw_box_files_rotate(directory, &(gw_box_limits_t){0, 0, 2, true, 0}); // The newest always stays.
    TEST_ASSERT_EQUAL(3, count_files());
    (void)close(directory);
}

TEST(test_frozen_writer_never_blocks_the_gateway) {
    start();
    TEST_ASSERT_EQUAL(0, kill(box.writer.pid, SIGSTOP));
    const gw_box_order_t order = stopped("estop_line");
    const iw_time_us_t begin_us = iwl_clock_now_us();
    unsigned written = 0;
    while (written < 100000U && gw_box_write(&box, &order)) {
        written++;
    }
    TEST_ASSERT_LESS_THAN(100000U, written);
    TEST_ASSERT_LESS_THAN(1000000U, iwl_clock_now_us() - begin_us);
    TEST_ASSERT_EQUAL(GW_CHILD_SILENT, gw_box_take(&box));
    TEST_ASSERT_EQUAL(0, kill(box.writer.pid, SIGKILL));
}

TEST(test_writer_ignores_signals_of_terminal_and_service) {
    static const int signals[] = {SIGINT, SIGTERM, SIGHUP};
    start();
    record("estop_line", 0); // The writer has started.
    for (size_t i = 0; i < sizeof signals / sizeof signals[0]; i++) {
        TEST_ASSERT_EQUAL(0, kill(box.writer.pid, signals[i]));
        record("estop_line", 0);
    }
}

TEST(test_killed_writer_is_detected_and_started_again) {
    start();
    TEST_ASSERT_EQUAL(0, kill(box.writer.pid, SIGKILL));
    TEST_ASSERT_EQUAL(GW_CHILD_ENDED, wait_news());
    TEST_ASSERT_EQUAL(-1, box.writer.fd);
    TEST_ASSERT_EQUAL(GW_CHILD_SILENT, gw_box_take(&box));
    const gw_box_order_t order = stopped("estop_line");
    TEST_ASSERT_FALSE(gw_box_write(&box, &order)); // Too early
    box.writer.started_us -= 10000000U;
    record("estop_line", 0);
}

TEST(test_kill_of_the_gateway_is_recorded_only_while_sending) {
    for (int sending = 0; sending < 2; sending++) {
        start();
        (void)stopped("");
        const blackbox_entry_t setpoint = {.at_us = iwl_clock_now_us(),
                                           .kind = BLACKBOX_FRAME,
                                           .number = 266,
                                           .a = 5,
                                           .b = IW_CAN_ECHO,
                                           .as = {.data = {1, 1, 0x2C, 7, 0xD0}}};
        blackbox_ring_put(box.ring, &setpoint);
        atomic_store(&box.ring->sending, sending != 0);
        (void)close(box.writer.fd); // Same effect as a kill
        box.writer.fd = -1;
        box_end(&box);
        open_box = false;
    }
    TEST_ASSERT_EQUAL(3, count_files());
    const char *text = read_file("stop-000001-gateway_died.jsonl");
    TEST_ASSERT_NOT_NULL(strstr(text, "the last ones left 300 mm/s and right 0 mm/s"));
}

/// Recording of a rolling machine: it is no stop, so `box.stop` still refers to the last stop.
TEST(test_rolling_is_recorded_and_is_no_stop) {
    static const iw_codec_wheel_t line;
    iw_snapshot_t seen = {.state = IW_STATE_LISTENING, .at_us = iwl_clock_now_us() - GW_BOX_AFTER_US};
    sock_log_t log;
    start();
    record("estop_line", 0);
    sock_log_open(&log, SOCK_LOG_ERROR);
    seen.wheel[IW_LEFT] = (iw_snapshot_wheel_t){.telemetry = &line, .speed_mm_s = 1500};
    seen.wheel[IW_RIGHT] = (iw_snapshot_wheel_t){.telemetry = &line, .speed_mm_s = -101, .heard = true};
    gw_record_rolling(&box, &log, &seen);
    TEST_ASSERT_EQUAL(GW_CHILD_MESSAGE, wait_news());
    TEST_ASSERT_EQUAL(0, box.last.number);
    TEST_ASSERT_EQUAL(0, box.last.error);
    TEST_ASSERT_EQUAL(3, box.stop.number);
    TEST_ASSERT_TRUE(is_there("stop-000002-rolling.log") && is_there("stop-000002-rolling.conf"));
    const char *text = read_file("stop-000002-rolling.jsonl");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"cause\":\"rolling\",\"side\":\"right\","), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "use its parking brake"), text);
    sock_log_close(&log);
}

TEST(test_zero_blackbox_s_has_a_ring_and_no_writer) {
    config.record.blackbox_s = 0;
    start();
    TEST_ASSERT_EQUAL(-1, box.writer.fd);
    TEST_ASSERT_NOT_NULL(box.ring);
    const gw_box_order_t order = stopped("estop_line");
    TEST_ASSERT_EQUAL(-1, access(config.record.directory, F_OK));
    (void)order;
}
