// SPDX-License-Identifier: MIT
// The directory of recordings: rotation, its cost, requested recordings, the reserve. No writer process runs.
#include "disk/box_files.h"

#include "folder.h"
#include "unit.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

static char records[96];

void setUp(void) {
    folder_make();
    (void)snprintf(records, sizeof records, "%s/records", folder);
}

void tearDown(void) {
    folder_remove();
}

static bool is_there(const char *name) {
    char path[256];
    (void)snprintf(path, sizeof path, "%s/%s", records, name);
    return file_exists(path);
}

static unsigned count_files(void) {
    return files_in(records, "stop-");
}

/// Writes the recordings `first` to `last` of a stop with this speed, without the writer process.
static void make_recordings(unsigned first, unsigned last, int speed_mm_s) {
    for (unsigned number = first; number <= last; number++) {
        char path[256];
        (void)snprintf(path, sizeof path, "%s/stop-%06u-made.jsonl", records, number);
        FILE *file = fopen(path, "w");
        TEST_ASSERT_NOT_NULL(file);
        (void)fprintf(file, "{}\n{\"type\":\"why\",\"applied_left_mm_s\":%d,\"applied_right_mm_s\":0,\"at_us\":1}\n",
                      speed_mm_s);
        (void)fclose(file);
    }
}

/// Opens a record directory in memory, for tests with many files.
static int open_in_memory(void) {
    (void)snprintf(records, sizeof records, "%s", folder_in_memory());
    return gw_box_files_open(records);
}

static unsigned long calls; // Number of calls that read the state of a file.

int __wrap_fstatat(int directory, const char *name, struct stat *out_status, int flags);
int __real_fstatat(int directory, const char *name, struct stat *out_status, int flags);

int __wrap_fstatat(int directory, const char *name, struct stat *out_status, int flags) {
    calls++;
    return __real_fstatat(directory, name, out_status, flags);
}

/// The first pass over the directory reads the state of each file; no other does.
TEST(test_rotation_cost_per_recording_is_constant) {
    static const unsigned counts[] = {32, 1000, 10000};
    const int directory = open_in_memory();
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        for (unsigned file = 0; file < counts[i] * GW_BOX_ENDINGS; file++) {
            char name[64];
            (void)snprintf(name, sizeof name, "stop-%06u-made%s", file / GW_BOX_ENDINGS + 1U,
                           gw_box_endings[file % GW_BOX_ENDINGS]);
            const int fd = openat(directory, name, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
            TEST_ASSERT_EQUAL(0, close(fd));
        }
        calls = 0;
        gw_box_files_rotate(directory, &(gw_box_limits_t){8, UINT64_MAX, counts[i] + 1U, true, 0});
        TEST_ASSERT_LESS_OR_EQUAL(3UL * counts[i] + 100UL, calls);
        TEST_ASSERT_EQUAL(8U * GW_BOX_ENDINGS, count_files());
    }
    (void)close(directory);
}

/// This number of recordings requires more than one pass over the directory.
TEST(test_rotation_of_33000_recordings_retains_motion) {
    const int directory = open_in_memory();
    make_recordings(1, 3, 500);
    make_recordings(4, 33000, 0);
    gw_box_files_rotate(directory, &(gw_box_limits_t){8, UINT64_MAX, 33000, false, 0});
    TEST_ASSERT_EQUAL(8, count_files());
    TEST_ASSERT_TRUE(is_there("stop-000001-made.jsonl"));
    TEST_ASSERT_TRUE(is_there("stop-000003-made.jsonl"));
    TEST_ASSERT_FALSE(is_there("stop-032995-made.jsonl"));
    TEST_ASSERT_TRUE(is_there("stop-032996-made.jsonl"));
    (void)close(directory);
}

TEST(test_requested_recordings_beyond_the_limit_are_removed) {
    const int directory = gw_box_files_open(records);
    for (unsigned number = 1; number <= 4U; number++) {
        char name[64];
        (void)snprintf(name, sizeof name, "stop-%06u-%s.jsonl", number, GW_BOX_REQUESTED);
        TEST_ASSERT_EQUAL(0, close(openat(directory, name, O_WRONLY | O_CREAT | O_CLOEXEC, 0644)));
    }
    make_recordings(5, 5, 0);
    gw_box_files_limit_requested(directory, 1);
    TEST_ASSERT_EQUAL(2, count_files());
    TEST_ASSERT_TRUE(is_there("stop-000004-" GW_BOX_REQUESTED ".jsonl"));
    TEST_ASSERT_TRUE(is_there("stop-000005-made.jsonl"));
    (void)close(directory);
}

TEST(test_recording_of_a_single_file_can_be_dropped) {
    const int directory = gw_box_files_open(records);
    make_recordings(1, 1, 0);
    TEST_ASSERT_TRUE(gw_box_files_drop_oldest(directory, &(gw_box_limits_t){.below = 2}));
    TEST_ASSERT_EQUAL(0, count_files());
    (void)close(directory);
}

TEST(test_reserve_that_cannot_be_allocated_is_removed) {
    struct rlimit before;
    const int directory = gw_box_files_open(records);
    TEST_ASSERT_EQUAL(0, getrlimit(RLIMIT_FSIZE, &before));
    const struct rlimit small = {.rlim_cur = 4096, .rlim_max = before.rlim_max};
    (void)signal(SIGXFSZ, SIG_IGN);
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &small));
    gw_box_files_reserve(directory, 1000000U);
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &before));
    TEST_ASSERT_FALSE(is_there("reserve"));
    gw_box_files_reserve(directory, 1000000U);
    TEST_ASSERT_TRUE(is_there("reserve"));
    (void)close(directory);
}
