// SPDX-License-Identifier: MIT
// First actions of every program: signals, standard streams and arguments.
#include "begin/begin.h"

#include "unit.h"

#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#define COUNT(array) ((int)(sizeof(array) / sizeof(array)[0]))

static int saved[3];

void setUp(void) {
    (void)fflush(stdout); // One test opens stdout again.
    for (int fd = 0; fd < COUNT(saved); fd++) {
        saved[fd] = fcntl(fd, F_DUPFD_CLOEXEC, COUNT(saved));
    }
    (void)signal(SIGPIPE, SIG_DFL);
}

void tearDown(void) {
    (void)fflush(stderr);
    for (int fd = 0; fd < COUNT(saved); fd++) {
        (void)dup2(saved[fd], fd);
        (void)close(saved[fd]);
    }
}

static int begin(char *argument) {
    char name[] = "program";
    char good[] = "good";
    char *arguments[] = {name, good, argument, NULL};
    return begin_program("program", (argument != NULL) ? 3 : 2, arguments);
}

TEST(test_begin_write_to_closed_log_returns_error) {
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    (void)close(ends[0]);
    (void)dup2(ends[1], STDERR_FILENO);
    (void)close(ends[1]);
    const int code = begin(NULL);
    const ssize_t count = write(STDERR_FILENO, "x", 1);
    (void)dup2(saved[STDERR_FILENO], STDERR_FILENO);
    TEST_ASSERT_EQUAL_INT(0, code);
    TEST_ASSERT_EQUAL_INT(-1, count);
}

TEST(test_begin_closed_streams_are_opened) {
    struct stat null;
    struct stat found[COUNT(saved)] = {{.st_rdev = 0}};
    for (int fd = 0; fd < COUNT(saved); fd++) {
        (void)close(fd);
    }
    (void)begin(NULL);
    const int next = open("/dev/zero", O_RDONLY | O_CLOEXEC);
    for (int fd = 0; fd < COUNT(saved); fd++) {
        (void)fstat(fd, &found[fd]);
        (void)dup2(saved[fd], fd);
    }
    TEST_ASSERT_EQUAL_INT(0, stat("/dev/null", &null));
    TEST_ASSERT_TRUE(next > STDERR_FILENO);
    (void)close(next);
    for (int fd = 0; fd < COUNT(saved); fd++) {
        TEST_ASSERT_TRUE(null.st_rdev == found[fd].st_rdev);
    }
}

TEST(test_begin_open_streams_are_unchanged) {
    struct stat before;
    struct stat after;
    (void)fstat(STDOUT_FILENO, &before);
    (void)begin(NULL);
    (void)fstat(STDOUT_FILENO, &after);
    TEST_ASSERT_TRUE(before.st_ino == after.st_ino && before.st_dev == after.st_dev);
}

TEST(test_begin_empty_or_bare_argument_is_refused) {
    char empty[] = "";
    char bare[] = "--";
    char *const refused[] = {empty, bare};
    for (int i = 0; i < COUNT(refused); i++) {
        TEST_ASSERT_EQUAL_INT(EX_USAGE, begin(refused[i]));
    }
}

TEST(test_begin_other_argument_is_accepted) {
    char dash[] = "-";
    char longer[] = "--x";
    char three[] = "---";
    char space[] = " ";
    char *const accepted[] = {dash, longer, three, space};
    for (int i = 0; i < COUNT(accepted); i++) {
        TEST_ASSERT_EQUAL_INT(0, begin(accepted[i]));
    }
}

TEST(test_begin_option_is_not_a_value) {
    TEST_ASSERT_TRUE(begin_is_value("program", NULL));
    TEST_ASSERT_TRUE(begin_is_value("program", "-"));
    TEST_ASSERT_TRUE(begin_is_value("program", "a-b"));
    TEST_ASSERT_FALSE(begin_is_value("program", "-b"));
    TEST_ASSERT_FALSE(begin_is_value("program", "--listen-only"));
}
