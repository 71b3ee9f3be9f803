// SPDX-License-Identifier: MIT
// Signal handling that all bridges share, and a log without a reader.
#include "common/bridge_service.h"

#include "unit.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

void setUp(void) {
    (void)signal(SIGPIPE, SIG_DFL);
    bridge_service_take_signals();
}

TEST(test_service_write_to_closed_log_returns_error) {
    static const char words[] = "iwheel: a line\n";
    const int saved = dup(STDERR_FILENO);
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    (void)close(ends[0]);
    (void)dup2(ends[1], STDERR_FILENO);
    const ssize_t count = write(STDERR_FILENO, words, sizeof words - 1U);
    (void)dup2(saved, STDERR_FILENO);
    (void)close(saved);
    (void)close(ends[1]);
    TEST_ASSERT_EQUAL_INT(-1, count);
}

/// Fills what stderr is during the test, and returns the status flags that another holder of it sees after that.
static int flags_after_a_flood(int writer) {
    bridge_service_t service;
    const int saved = dup(STDERR_FILENO);
    (void)dup2(writer, STDERR_FILENO);
    bridge_service_open(&service);
    (void)alarm(10); // Ends this program if a line waits.
    for (int i = 0; i < 20000; i++) {
        (void)fprintf(stderr, "iwheel: line %d of a log that has no reader\n", i);
    }
    (void)alarm(0);
    (void)dup2(saved, STDERR_FILENO);
    (void)close(saved);
    return fcntl(writer, F_GETFL);
}

TEST(test_service_full_log_never_waits) {
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    TEST_ASSERT_EQUAL_INT(0, flags_after_a_flood(ends[1]) & O_NONBLOCK);
    (void)close(ends[0]);
    (void)close(ends[1]);
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM, 0, ends));
    (void)flags_after_a_flood(ends[1]);
    (void)close(ends[0]);
    (void)close(ends[1]);
    const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
    TEST_ASSERT_EQUAL_INT(0, grantpt(terminal) + unlockpt(terminal));
    const int stopped = open(ptsname(terminal), O_RDWR | O_NOCTTY);
    TEST_ASSERT_EQUAL_INT(0, flags_after_a_flood(stopped) & O_NONBLOCK);
    (void)close(stopped);
    (void)close(terminal);
}

TEST(test_service_log_in_a_file_is_complete) {
    char text[64] = "";
    char name[] = "/tmp/iwheel-log-XXXXXX";
    const int file = mkstemp(name);
    (void)unlink(name);
    TEST_ASSERT_EQUAL_INT(6, write(file, "before", 6));
    TEST_ASSERT_EQUAL_INT(0, flags_after_a_flood(file) & O_NONBLOCK);
    TEST_ASSERT_EQUAL_INT(34, pread(file, text, 34, 0));
    TEST_ASSERT_EQUAL_STRING("beforeiwheel: line 0 of a log that", text);
    (void)close(file);
}

TEST(test_service_signal_ends_the_current_and_next_wait) {
    TEST_ASSERT_TRUE(bridge_service_wait(NULL, 0, 0));
    (void)raise(SIGTERM); // The signal is blocked until the wait.
    TEST_ASSERT_FALSE(bridge_service_wait(NULL, 0, 10000));
    TEST_ASSERT_FALSE(bridge_service_wait(NULL, 0, -1));
}
