// SPDX-License-Identifier: MIT
#include "signals.h"

#include <stdbool.h>
#include <stddef.h>

// A signal handler has no argument for a context: these three cannot live elsewhere.
static volatile sig_atomic_t caught;
static bool catching;
static sigset_t let_in;

static void count(int signal_number) {
    (void)signal_number;
    caught = caught + 1;
}

void signals_catch(void) {
    struct sigaction action = {.sa_handler = count};
    sigset_t blocked;
    (void)sigemptyset(&blocked);
    const int caught_signals[] = {SIGINT, SIGTERM, SIGHUP};
    for (size_t i = 0; i < sizeof caught_signals / sizeof caught_signals[0]; i++) {
        (void)sigaddset(&blocked, caught_signals[i]);
        (void)sigaction(caught_signals[i], &action, NULL);
    }
    (void)sigprocmask(SIG_BLOCK, &blocked, &let_in);
    for (size_t i = 0; i < sizeof caught_signals / sizeof caught_signals[0]; i++) {
        (void)sigdelset(&let_in, caught_signals[i]);
    }
    catching = true;
}

unsigned signals_count(void) {
    return (unsigned)caught;
}

const sigset_t *signals_let_in(void) {
    return catching ? &let_in : NULL;
}
