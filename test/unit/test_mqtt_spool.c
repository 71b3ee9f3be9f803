// SPDX-License-Identifier: MIT
// Events that wait for the broker stay complete and in order, whatever happens to file, process and disk.
#include "spool.h"

#include "unit.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#define SMALL (2U * MQTT_SPOOL_EVENT_MAX)
#define COUNT 5000U

ssize_t __real_write(int file, const void *bytes, size_t length);
ssize_t __wrap_write(int file, const void *bytes, size_t length);
int __real_fdatasync(int file);
int __wrap_fdatasync(int file);
int __real_fsync(int file);
int __wrap_fsync(int file);
int __real_renameat(int from, const char *name, int to, const char *fresh);
int __wrap_renameat(int from, const char *name, int to, const char *fresh);

/// What the disk does.
static struct {
    pthread_t caller;      ///< Thread of the test.
    atomic_uint by_caller; ///< Calls that wait for the disk, by the thread of the test.
    atomic_bool hangs;     ///< No sync ends.
    atomic_bool breaks;    ///< Each sync fails.
    atomic_bool stumbles;  ///< The next sync fails.
    atomic_uint syncs;     ///< Syncs that began.
} disk;

static char folder[64];
static char path[80];
static mqtt_spool_t spool;

/// Returns true in the thread of the test.
static bool note_caller(void) {
    const bool ours = pthread_equal(pthread_self(), disk.caller) != 0;
    if (ours) {
        atomic_fetch_add(&disk.by_caller, 1U);
    }
    return ours;
}

ssize_t __wrap_write(int file, const void *bytes, size_t length) {
    (void)note_caller();
    return __real_write(file, bytes, length);
}

int __wrap_fdatasync(int file) {
    const bool ours = note_caller();
    atomic_fetch_add(&disk.syncs, 1U);
    while (atomic_load(&disk.hangs) && !ours) {
        (void)usleep(1000);
    }
    if (atomic_exchange(&disk.stumbles, false) || atomic_load(&disk.breaks)) {
        errno = EIO;
        return -1;
    }
    return __real_fdatasync(file);
}

int __wrap_fsync(int file) {
    (void)note_caller();
    return __real_fsync(file);
}

int __wrap_renameat(int from, const char *name, int to, const char *fresh) {
    (void)note_caller();
    return __real_renameat(from, name, to, fresh);
}

/// Gives all that is collected to the disk and waits for its result. Unlike `flush` it begins no new file.
static void settle(void) {
    mqtt_spool_sync(&spool);
    for (unsigned i = 0; i < 1000U && (spool.busy || mqtt_disk_has_more(&spool.disk)); i++) {
        mqtt_disk_wait(&spool.disk, 10);
        mqtt_spool_sync(&spool);
    }
    TEST_ASSERT_FALSE(spool.busy);
}

void setUp(void) {
    disk.caller = pthread_self();
    atomic_store(&disk.by_caller, 0U);
    atomic_store(&disk.hangs, false);
    atomic_store(&disk.breaks, false);
    atomic_store(&disk.stumbles, false);
    // In memory, where there is such a folder: each new file waits for the disk.
    (void)snprintf(folder, sizeof folder, "%s/iwheel-spool-XXXXXX",
                   (access("/dev/shm", W_OK) == 0) ? "/dev/shm" : "/tmp");
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    (void)snprintf(path, sizeof path, "%s/" MQTT_SPOOL_FILE, folder);
    TEST_ASSERT_TRUE(mqtt_spool_open(&spool, folder, SMALL));
}

void tearDown(void) {
    atomic_store(&disk.hangs, false);
    atomic_store(&disk.breaks, false);
    (void)mqtt_spool_close(&spool);
    (void)unlink(path);
    (void)rmdir(folder);
}

static void add(unsigned number) {
    char text[32];
    const int length = snprintf(text, sizeof text, "{\"n\":%u}", number);
    TEST_ASSERT_TRUE(mqtt_spool_add(&spool, "stop", text, (size_t)length, number));
}

static void reopen(void) {
    TEST_ASSERT_TRUE(mqtt_spool_close(&spool));
    TEST_ASSERT_TRUE(mqtt_spool_open(&spool, folder, SMALL));
}

/// The spool contains the numbers `first` to `last`, each as it was added.
static void expect(unsigned first, unsigned last) {
    mqtt_spool_event_t event;
    uint64_t number = 0;
    for (unsigned i = first; i <= last; i++) {
        char text[32];
        (void)snprintf(text, sizeof text, "{\"n\":%u}", i);
        TEST_ASSERT_TRUE(mqtt_spool_after(&spool, number, &event));
        TEST_ASSERT_EQUAL_STRING("stop", event.name);
        TEST_ASSERT_EQUAL_size_t(strlen(text), event.length);
        TEST_ASSERT_EQUAL_MEMORY(text, event.payload, event.length);
        TEST_ASSERT_TRUE(event.number > number);
        number = event.number;
    }
    TEST_ASSERT_FALSE(mqtt_spool_after(&spool, number, &event));
    TEST_ASSERT_EQUAL_size_t((last >= first) ? last - first + 1U : 0U, spool.waiting);
}

static size_t read_all(char *out, size_t size) {
    settle();
    FILE *file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL(file);
    const size_t length = fread(out, 1, size, file);
    (void)fclose(file);
    return length;
}

static void write_all(const char *bytes, size_t length) {
    FILE *file = fopen(path, "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_size_t(length, fwrite(bytes, 1, length, file));
    (void)fclose(file);
}

TEST(test_spool_new_is_empty) {
    expect(1, 0);
    reopen();
    expect(1, 0);
}

TEST(test_spool_events_survive_a_restart_in_order) {
    for (unsigned i = 1; i <= 5; i++) {
        add(i);
    }
    expect(1, 5);
    reopen();
    expect(1, 5);
    add(6);
    expect(1, 6);
    TEST_ASSERT_EQUAL_UINT64(6, spool.mark);
}

TEST(test_spool_confirmed_events_do_not_return) {
    for (unsigned i = 1; i <= 5; i++) {
        add(i);
    }
    mqtt_spool_confirm(&spool, 3);
    expect(4, 5);
    reopen();
    expect(4, 5);
    mqtt_spool_confirm(&spool, 5);
    reopen();
    expect(1, 0);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(5, spool.last, "numbers go on");
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(5, spool.mark, "the mark stays");
}

TEST(test_spool_deferred_event_stays_while_others_are_confirmed) {
    mqtt_spool_event_t event;
    for (unsigned i = 1; i <= 5; i++) {
        add(i);
    }
    mqtt_spool_set_aside(&spool, 2);
    mqtt_spool_set_aside(&spool, 9); // There is no event 9.
    mqtt_spool_confirm(&spool, 4);
    TEST_ASSERT_EQUAL_size_t(1, spool.aside);
    TEST_ASSERT_EQUAL_size_t(2, spool.waiting);
    TEST_ASSERT_TRUE(mqtt_spool_after(&spool, 0, &event));
    TEST_ASSERT_EQUAL_UINT64(2, event.number);
    TEST_ASSERT_TRUE(event.aside);
    mqtt_spool_confirm(&spool, 5);
    for (unsigned i = 0; i < 2U; i++) { // The second pass reads a file that was written again.
        reopen();
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(5, spool.last, "numbers go on");
        TEST_ASSERT_EQUAL_size_t(1, spool.waiting);
        TEST_ASSERT_TRUE(mqtt_spool_after(&spool, 0, &event));
        TEST_ASSERT_EQUAL_UINT64(2, event.number);
        TEST_ASSERT_FALSE_MESSAGE(event.aside, "after a restart it is tried like the others");
    }
    mqtt_spool_set_aside(&spool, 2);
    mqtt_spool_confirm_aside(&spool, 2);
    reopen();
    expect(1, 0);
    add(6);
    expect(6, 6);
}

TEST(test_spool_full_drops_deferred_events_first) {
    mqtt_spool_event_t event;
    unsigned last = 1;
    add(last);
    mqtt_spool_set_aside(&spool, 1);
    while (spool.dropped < 1U) {
        last++;
        add(last);
    }
    TEST_ASSERT_EQUAL_size_t(0, spool.aside);
    TEST_ASSERT_TRUE(mqtt_spool_after(&spool, 0, &event));
    TEST_ASSERT_EQUAL_UINT64(2, event.number);
}

TEST(test_spool_writable_by_others_or_linked_is_refused) {
    char second[96];
    TEST_ASSERT_TRUE(mqtt_spool_close(&spool));
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 0777));
    TEST_ASSERT_FALSE(mqtt_spool_open(&spool, folder, SMALL));
    TEST_ASSERT_EQUAL_INT(EPERM, errno);
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 0700));
    (void)snprintf(second, sizeof second, "%s/second", folder);
    char file[96];
    (void)snprintf(file, sizeof file, "%s/" MQTT_SPOOL_FILE, folder);
    TEST_ASSERT_EQUAL_INT(0, link(file, second));
    TEST_ASSERT_FALSE(mqtt_spool_open(&spool, folder, SMALL));
    TEST_ASSERT_EQUAL_INT(EPERM, errno);
    TEST_ASSERT_EQUAL_INT(0, unlink(second));
    TEST_ASSERT_TRUE(mqtt_spool_open(&spool, folder, SMALL));
}

TEST(test_spool_file_cut_at_any_byte_has_all_events_before_it) {
    char bytes[1024];
    size_t ends[6] = {0};
    (void)mqtt_spool_close(&spool);
    (void)unlink(path);
    TEST_ASSERT_TRUE(mqtt_spool_open(&spool, folder, SMALL));
    ends[0] = read_all(bytes, sizeof bytes);
    for (unsigned i = 1; i <= 5; i++) {
        add(i);
        ends[i] = read_all(bytes, sizeof bytes);
    }
    const size_t length = ends[5];
    for (size_t cut = 0; cut <= length; cut++) {
        unsigned whole = 0;
        (void)mqtt_spool_close(&spool);
        write_all(bytes, cut);
        TEST_ASSERT_TRUE(mqtt_spool_open(&spool, folder, SMALL));
        while (whole < 5U && ends[whole + 1U] <= cut) {
            whole++;
        }
        expect(1, whole);
        add(whole + 1U); // New events follow after the cut.
        reopen();
        expect(1, whole + 1U);
    }
}

TEST(test_spool_flipped_bit_loses_only_events_from_there_on) {
    char bytes[1024];
    for (unsigned i = 1; i <= 3; i++) {
        add(i);
    }
    const size_t length = read_all(bytes, sizeof bytes);
    for (size_t at = 0; at < length; at++) {
        mqtt_spool_event_t event;
        uint64_t number = 0;
        unsigned found = 0;
        (void)mqtt_spool_close(&spool);
        bytes[at] = (char)(bytes[at] ^ 0x20);
        write_all(bytes, length);
        bytes[at] = (char)(bytes[at] ^ 0x20);
        TEST_ASSERT_TRUE(mqtt_spool_open(&spool, folder, SMALL));
        for (; mqtt_spool_after(&spool, number, &event); number = event.number) {
            found++;
        }
        TEST_ASSERT_TRUE_MESSAGE(found < 3U, "the fault is not reported");
        expect(1, found);
    }
}

TEST(test_spool_half_written_new_file_is_ignored) {
    char fresh[96];
    add(1);
    (void)mqtt_spool_close(&spool);
    (void)snprintf(fresh, sizeof fresh, "%s.new", path);
    FILE *file = fopen(fresh, "wb");
    TEST_ASSERT_NOT_NULL(file);
    (void)fputs("iwspool1 half", file);
    (void)fclose(file);
    TEST_ASSERT_TRUE(mqtt_spool_open(&spool, folder, SMALL));
    expect(1, 1);
    settle();
    TEST_ASSERT_NOT_EQUAL_INT(0, access(fresh, F_OK));
}

TEST(test_spool_impossible_number_is_damage) {
    add(1);
    mqtt_spool_confirm(&spool, UINT64_MAX);
    reopen();
    add(2);
    expect(1, 2);
}

TEST(test_spool_full_drops_the_oldest_and_counts) {
    unsigned last = 0;
    while (spool.dropped < 10U) {
        last++;
        add(last);
    }
    expect(11, last);
    reopen();
    TEST_ASSERT_TRUE(spool.waiting > 0U);
    mqtt_spool_event_t event;
    TEST_ASSERT_TRUE(mqtt_spool_after(&spool, last - 1U, &event));
    TEST_ASSERT_EQUAL_UINT64(last, event.number);
}

TEST(test_spool_file_stays_bounded_over_5000_events) {
    char bytes[4U * SMALL];
    for (unsigned i = 1; i <= COUNT; i++) {
        add(i);
        mqtt_spool_confirm(&spool, i);
        mqtt_spool_sync(&spool);
        TEST_ASSERT_TRUE(spool.file_bytes <= 2U * SMALL + MQTT_SPOOL_EVENT_MAX);
    }
    TEST_ASSERT_TRUE(read_all(bytes, sizeof bytes) <= 2U * SMALL + MQTT_SPOOL_EVENT_MAX);
    reopen();
    expect(1, 0);
    TEST_ASSERT_EQUAL_UINT64(COUNT, spool.last);
}

TEST(test_spool_event_too_long_is_counted) {
    static char text[MQTT_SPOOL_EVENT_MAX];
    TEST_ASSERT_FALSE(mqtt_spool_add(&spool, "stop", text, sizeof text, 0));
    TEST_ASSERT_EQUAL_UINT64(1, spool.dropped);
    add(1);
    expect(1, 1);
}

TEST(test_spool_disk_full_at_any_byte_loses_nothing) {
    struct rlimit before;
    (void)getrlimit(RLIMIT_FSIZE, &before);
    (void)signal(SIGXFSZ, SIG_IGN);
    for (rlim_t limit = 0; limit < 400U; limit++) {
        tearDown();
        setUp();
        const struct rlimit small = {limit, before.rlim_max};
        (void)setrlimit(RLIMIT_FSIZE, &small);
        for (unsigned i = 1; i <= 6; i++) {
            add(i);
            settle();
        }
        mqtt_spool_confirm(&spool, 1);
        settle();
        (void)setrlimit(RLIMIT_FSIZE, &before);
        expect(2, 6);
        mqtt_spool_poll(&spool);
        settle();
        TEST_ASSERT_FALSE(spool.behind);
        reopen();
        expect(2, 6);
    }
}

TEST(test_spool_disk_full_and_killed_retains_written_events) {
    struct rlimit before;
    (void)getrlimit(RLIMIT_FSIZE, &before);
    (void)signal(SIGXFSZ, SIG_IGN);
    add(1);
    settle();
    const struct rlimit small = {100, before.rlim_max};
    (void)setrlimit(RLIMIT_FSIZE, &small);
    add(2);
    settle();
    add(3);
    settle();
    TEST_ASSERT_TRUE(spool.behind);
    TEST_ASSERT_TRUE(mqtt_spool_close(&spool)); // The disk is still full: closing changes nothing, as a kill does.
    (void)setrlimit(RLIMIT_FSIZE, &before);
    TEST_ASSERT_TRUE(mqtt_spool_open(&spool, folder, SMALL));
    TEST_ASSERT_TRUE(spool.waiting >= 1U);
    expect(1, (unsigned)spool.waiting);
}

TEST(test_spool_all_calls_to_the_disk_are_made_by_its_thread) {
    reopen();
    for (unsigned i = 1; i <= COUNT; i++) {
        add(i);
        mqtt_spool_confirm(&spool, i / 2U);
        mqtt_spool_sync(&spool);
    }
    atomic_store(&disk.breaks, true);
    mqtt_spool_sync(&spool);
    mqtt_spool_poll(&spool);
    settle();
    atomic_store(&disk.breaks, false);
    mqtt_spool_poll(&spool);
    reopen();
    TEST_ASSERT_EQUAL_UINT(0, atomic_load(&disk.by_caller));
    TEST_ASSERT_GREATER_THAN_UINT(0, atomic_load(&disk.syncs));
}

TEST(test_spool_disk_that_hangs_delays_no_caller) {
    settle();
    atomic_store(&disk.hangs, true);
    add(1);
    mqtt_spool_sync(&spool);
    TEST_ASSERT_FALSE(spool.behind);
    for (unsigned i = 2; i <= COUNT; i++) { // More than the file may hold: it is written again.
        add(i);
        mqtt_spool_confirm(&spool, i - 1U);
        mqtt_spool_sync(&spool);
    }
    for (unsigned i = 0; i < 6U; i++) {
        mqtt_spool_poll(&spool);
    }
    TEST_ASSERT_TRUE_MESSAGE(spool.behind, "a disk that does not answer is reported");
    TEST_ASSERT_FALSE_MESSAGE(mqtt_spool_close(&spool), "the thread still uses the memory");
    atomic_store(&disk.hangs, false);
    settle();
    TEST_ASSERT_FALSE(spool.behind);
    expect(COUNT, COUNT);
    TEST_ASSERT_EQUAL_UINT(0, atomic_load(&disk.by_caller));
    reopen();
    expect(COUNT, COUNT);
}

TEST(test_spool_disk_that_fails_is_written_again_once_it_works) {
    char bytes[1024];
    settle();
    atomic_store(&disk.breaks, true);
    add(1);
    settle();
    TEST_ASSERT_TRUE(spool.behind);
    add(2);
    mqtt_spool_poll(&spool);
    settle();
    TEST_ASSERT_TRUE(spool.behind);
    atomic_store(&disk.breaks, false);
    add(3);
    settle();
    TEST_ASSERT_TRUE_MESSAGE(spool.behind, "an addition alone does not complete the file");
    mqtt_spool_poll(&spool);
    settle();
    TEST_ASSERT_FALSE(spool.behind);
    TEST_ASSERT_GREATER_THAN_size_t(0, read_all(bytes, sizeof bytes));
    reopen();
    expect(1, 3);
}

/// Breaks the disk until a job with the event 1 has failed.
static void fail_first_event(void) {
    settle();
    atomic_store(&disk.breaks, true);
    add(1);
    settle();
    TEST_ASSERT_TRUE(spool.behind);
    atomic_store(&disk.breaks, false);
}

TEST(test_spool_event_during_a_rewrite_is_in_the_file) {
    fail_first_event();
    atomic_store(&disk.hangs, true);
    mqtt_spool_poll(&spool); // The disk has the whole file, without the event 2.
    add(2);
    mqtt_spool_confirm(&spool, 1);
    mqtt_spool_sync(&spool);
    TEST_ASSERT_TRUE_MESSAGE(spool.behind, "the new file is not complete");
    atomic_store(&disk.hangs, false);
    settle();
    TEST_ASSERT_FALSE(spool.behind);
    reopen();
    expect(2, 2);
}

TEST(test_spool_rewrite_that_fails_loses_no_later_event) {
    fail_first_event();
    atomic_store(&disk.hangs, true);
    mqtt_spool_poll(&spool);
    add(2);
    atomic_store(&disk.breaks, true);
    atomic_store(&disk.hangs, false);
    settle();
    TEST_ASSERT_TRUE(spool.behind);
    atomic_store(&disk.breaks, false);
    mqtt_spool_poll(&spool);
    settle();
    TEST_ASSERT_FALSE(spool.behind);
    reopen();
    expect(1, 2);
}

TEST(test_spool_close_rewrites_a_file_that_is_behind) {
    fail_first_event();
    add(2);
    reopen(); // No poll before.
    expect(1, 2);
    settle();
    atomic_store(&disk.stumbles, true);
    add(3); // The job of the flush itself fails.
    reopen();
    expect(1, 3);
    settle();
    atomic_store(&disk.breaks, true);
    add(4);
    TEST_ASSERT_TRUE_MESSAGE(mqtt_spool_flush(&spool), "a disk that refuses everything does not hang");
    TEST_ASSERT_TRUE(spool.behind);
    atomic_store(&disk.breaks, false);
    reopen();
    expect(1, 4);
}

TEST(test_spool_event_is_on_the_disk_before_the_thread_rests) {
    settle();
    const unsigned before = atomic_load(&disk.syncs);
    add(1);
    settle();
    TEST_ASSERT_EQUAL_UINT(before + 1U, atomic_load(&disk.syncs));
    mqtt_spool_confirm(&spool, 1);
    settle();
    TEST_ASSERT_EQUAL_UINT_MESSAGE(before + 1U, atomic_load(&disk.syncs), "a confirmation needs no sync");
}

TEST(test_spool_open_in_another_process_is_refused) {
    mqtt_spool_t other;
    TEST_ASSERT_FALSE(mqtt_spool_open(&other, folder, SMALL));
    TEST_ASSERT_EQUAL_INT(EWOULDBLOCK, errno);
    TEST_ASSERT_FALSE(mqtt_spool_open(&other, "/nowhere", SMALL));
    TEST_ASSERT_EQUAL_INT(ENOENT, errno);
}
