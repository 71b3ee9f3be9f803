// SPDX-License-Identifier: MIT
// Signal handling that all bridges share, and a log without a reader.
#include "common/bridge_service.h"

#include "unit.h"

#include <signal.h>
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

TEST(test_service_signal_ends_the_current_and_next_wait) {
    TEST_ASSERT_TRUE(bridge_service_wait(NULL, 0, 0));
    (void)raise(SIGTERM); // The signal is blocked until the wait.
    TEST_ASSERT_FALSE(bridge_service_wait(NULL, 0, 10000));
    TEST_ASSERT_FALSE(bridge_service_wait(NULL, 0, -1));
}
