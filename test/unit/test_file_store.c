// SPDX-License-Identifier: MIT
// Process that stores a file between runs: what it reads, writes and sets aside, and which files and folders it
// refuses.
#include "disk/file_store.h"
#include "sockets/owners.h"

#include "folder.h"
#include "unit.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static size_t length;
static gw_file_store_t store;
static const char *reply;
static int error;
static char second[128];
static int fsync_error;  ///< Error of fsync in a process that is opened after it is set; 0: none
static bool fsync_waits; ///< The same: fsync waits until the file "flush" exists
static bool time_flies;  ///< The same: pauses take no time

int nanosleep(const struct timespec *pause, struct timespec *left) {
    return time_flies ? 0 : clock_nanosleep(CLOCK_REALTIME, 0, pause, left);
}

int fsync(int fd) {
    while (fsync_waits && !file_exists(in_folder("flush"))) {
        (void)poll(NULL, 0, 1);
    }
    if (fsync_error != 0) {
        errno = fsync_error;
        return -1;
    }
    return (int)syscall(SYS_fsync, fd);
}

void setUp(void) {
    folder_make();
}

void tearDown(void) {
    folder_remove();
}

static gw_file_store_news_t next_news(void) {
    gw_file_store_news_t news = GW_FILE_STORE_NO_NEWS;
    struct pollfd wait = {.fd = store.child.fd, .events = POLLIN};
    while (news == GW_FILE_STORE_NO_NEWS && poll(&wait, 1, 5000) == 1) {
        news = gw_file_store_receive(&store, &reply, &length, &error);
    }
    return news;
}

static void open_store(const char *directory, gw_file_store_news_t expected) {
    error = 0;
    TEST_ASSERT_EQUAL_INT(0, gw_file_store_open(&store, directory, "file"));
    TEST_ASSERT_FALSE_MESSAGE(gw_file_store_write(&store, "x", 1), "not before it has answered");
    TEST_ASSERT_EQUAL_INT(expected, next_news());
}

/// Adds a second name to an existing file.
static void name_again(const char *name, const char *again) {
    (void)strcpy(second, in_folder(again));
    TEST_ASSERT_EQUAL_INT(0, link(in_folder(name), second));
}

static void put_file(const char *name, const char *content) {
    file_put(in_folder(name), content, strlen(content));
}

/// Writes the text and waits for the result.
static void write_text(const char *text, gw_file_store_news_t expected) {
    TEST_ASSERT_TRUE(gw_file_store_write(&store, text, strlen(text)));
    TEST_ASSERT_EQUAL_INT(expected, next_news());
}

static void assert_file(const char *name, const char *content) {
    TEST_ASSERT_EQUAL_STRING(content, file_text(in_folder(name)));
}

TEST(test_file_store_writes_reads_back_and_sets_aside) {
    open_store(folder, GW_FILE_STORE_ABSENT);
    TEST_ASSERT_TRUE(gw_file_store_write(&store, "one", 3));
    TEST_ASSERT_FALSE_MESSAGE(gw_file_store_write(&store, "two", 3), "one at a time");
    TEST_ASSERT_EQUAL_INT(GW_FILE_STORE_WRITTEN, next_news());
    assert_file("file", "one");
    gw_file_store_close(&store);
    open_store(folder, GW_FILE_STORE_READ);
    TEST_ASSERT_EQUAL_UINT(3, length);
    TEST_ASSERT_EQUAL_MEMORY("one", reply, 3);
    gw_file_store_set_aside(&store);
    write_text("two", GW_FILE_STORE_WRITTEN);
    assert_file("file.damaged", "one");
    assert_file("file", "two");
    TEST_ASSERT_FALSE(file_exists(in_folder("file.new")));
    gw_file_store_close(&store);
}

TEST(test_file_store_without_directory_fails_until_it_exists) {
    char missing[64];
    (void)snprintf(missing, sizeof missing, "%s/later", folder);
    open_store(missing, GW_FILE_STORE_FAILED);
    TEST_ASSERT_EQUAL_INT(ENOENT, error);
    write_text("one", GW_FILE_STORE_FAILED);
    TEST_ASSERT_EQUAL_INT(ENOENT, error);
    TEST_ASSERT_EQUAL_INT(0, mkdir(missing, 0700));
    write_text("two", GW_FILE_STORE_WRITTEN);
    assert_file("later/file", "two");
    gw_file_store_close(&store);
}

TEST(test_file_store_refuses_link_pipe_and_too_large_file) {
    put_file("other", "precious");
    TEST_ASSERT_EQUAL_INT(0, symlink("other", in_folder("file")));
    open_store(folder, GW_FILE_STORE_BAD);
    write_text("new", GW_FILE_STORE_WRITTEN);
    assert_file("other", "precious");
    assert_file("file", "new");
    gw_file_store_close(&store);
    (void)unlink(in_folder("file"));
    TEST_ASSERT_EQUAL_INT(0, mkfifo(in_folder("file"), 0600));
    open_store(folder, GW_FILE_STORE_BAD);
    gw_file_store_close(&store);
    (void)unlink(in_folder("file"));
    put_file("file", "");
    TEST_ASSERT_EQUAL_INT(0, truncate(in_folder("file"), (off_t)GW_FILE_STORE_TEXT_MAX + 1));
    open_store(folder, GW_FILE_STORE_BAD);
    TEST_ASSERT_EQUAL_INT(EFBIG, error);
    gw_file_store_close(&store);
}

TEST(test_file_store_failed_write_retains_the_old_file) {
    put_file("file", "old");
    TEST_ASSERT_EQUAL_INT(0, mkdir(in_folder("file.new"), 0755));
    open_store(folder, GW_FILE_STORE_READ);
    write_text("new", GW_FILE_STORE_FAILED);
    assert_file("file", "old");
    gw_file_store_close(&store);
}

TEST(test_file_store_reports_failed_fsync_and_rename) {
    put_file("file", "old");
    fsync_error = EIO;
    open_store(folder, GW_FILE_STORE_READ);
    fsync_error = 0;
    write_text("new", GW_FILE_STORE_FAILED);
    TEST_ASSERT_EQUAL_INT(EIO, error);
    assert_file("file", "old");
    gw_file_store_close(&store);
    (void)unlink(in_folder("file"));
    open_store(folder, GW_FILE_STORE_ABSENT);
    TEST_ASSERT_EQUAL_INT(0, mkdir(in_folder("file"), 0700));
    write_text("new", GW_FILE_STORE_FAILED);
    TEST_ASSERT_EQUAL_INT(EISDIR, error);
    TEST_ASSERT_FALSE(file_exists(in_folder("file.new")));
    gw_file_store_close(&store);
}

TEST(test_file_store_never_writes_into_an_existing_file) {
    put_file("file", "old");
    put_file("other", "precious");
    name_again("other", "file.new");
    open_store(folder, GW_FILE_STORE_READ);
    write_text("new", GW_FILE_STORE_WRITTEN);
    assert_file("other", "precious");
    assert_file("file", "new");
    TEST_ASSERT_EQUAL_INT(0, symlink("other", in_folder("file.new")));
    write_text("newer", GW_FILE_STORE_WRITTEN);
    assert_file("other", "precious");
    gw_file_store_close(&store);
}

/// A gateway that starts while the store process of the earlier one still writes must not begin with the older file.
TEST(test_file_store_read_waits_for_a_pending_write) {
    put_file("file", "old");
    fsync_waits = true;
    open_store(folder, GW_FILE_STORE_READ);
    fsync_waits = false;
    TEST_ASSERT_TRUE(gw_file_store_write(&store, "new", 3));
    for (unsigned ms = 0; ms < 5000U && !file_exists(in_folder("file.new")); ms++) {
        (void)poll(NULL, 0, 1);
    }
    gw_file_store_close(&store);
    TEST_ASSERT_EQUAL_INT(0, gw_file_store_open(&store, folder, "file"));
    (void)poll(NULL, 0, 50);
    put_file("flush", ""); // Now the write ends.
    TEST_ASSERT_EQUAL_INT(GW_FILE_STORE_READ, next_news());
    TEST_ASSERT_EQUAL_UINT(3, length);
    TEST_ASSERT_EQUAL_MEMORY("new", reply, 3);
    gw_file_store_close(&store);
}

TEST(test_file_store_read_does_not_wait_without_end) {
    put_file("file", "old");
    const int directory = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    TEST_ASSERT_EQUAL_INT(0, flock(directory, LOCK_EX));
    time_flies = true;
    open_store(folder, GW_FILE_STORE_READ);
    time_flies = false;
    TEST_ASSERT_EQUAL_MEMORY("old", reply, 3);
    gw_file_store_close(&store);
    (void)close(directory);
}

static void assert_not_read(int why) {
    open_store(folder, GW_FILE_STORE_BAD);
    TEST_ASSERT_EQUAL_INT(why, error);
    gw_file_store_close(&store);
}

TEST(test_file_store_refuses_file_with_second_name_or_other_owner) {
    put_file("file", "old");
    name_again("file", "again");
    assert_not_read(SOCK_FOLDER_FILE);
    TEST_ASSERT_EQUAL_INT(0, unlink(second));
    if (geteuid() != 0) {
        TEST_MESSAGE("SKIPPED in part: changing the owner of a file needs root");
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, chown(in_folder("file"), 65534, 65534));
    assert_not_read(SOCK_FOLDER_FILE);
}

static void assert_no_folder(const char *path, int why) {
    open_store(path, GW_FILE_STORE_FAILED);
    TEST_ASSERT_EQUAL_INT(why, error);
    write_text("new", GW_FILE_STORE_FAILED);
    TEST_ASSERT_EQUAL_INT(why, error);
    gw_file_store_close(&store);
}

TEST(test_file_store_refuses_folder_writable_by_others) {
    static const mode_t modes[] = {0777, 01777, 0775, 0757};
    for (size_t i = 0; i < sizeof modes / sizeof modes[0]; i++) {
        TEST_ASSERT_EQUAL_INT(0, chmod(folder, modes[i]));
        assert_no_folder(folder, SOCK_FOLDER_SHARED);
    }
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 0700));
    TEST_ASSERT_EQUAL_INT(0, symlink(".", strcpy(second, in_folder("link"))));
    assert_no_folder(second, ELOOP);
    strcat(second, "/");
    assert_no_folder(second, ELOOP);
    TEST_ASSERT_EQUAL_INT(0, unlink(in_folder("link")));
    if (geteuid() != 0) {
        TEST_MESSAGE("SKIPPED in part: changing the owner of a folder needs root");
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, chown(folder, 65534, 65534));
    assert_no_folder(folder, SOCK_FOLDER_FOREIGN);
    TEST_ASSERT_EQUAL_INT(0, chown(folder, 0, 0));
}

TEST(test_file_store_ended_process_is_reported_once) {
    TEST_ASSERT_EQUAL_INT(0, gw_file_store_open(&store, folder, "file"));
    (void)next_news();
    (void)shutdown(store.child.fd, SHUT_RDWR);
    (void)gw_file_store_write(&store, "new", 3);
    TEST_ASSERT_EQUAL_INT(GW_FILE_STORE_GONE, next_news());
    gw_file_store_close(&store);
    TEST_ASSERT_FALSE(gw_file_store_write(&store, "new", 3));
    TEST_ASSERT_EQUAL_INT(GW_FILE_STORE_NO_NEWS, gw_file_store_receive(&store, &reply, &length, &error));
}
