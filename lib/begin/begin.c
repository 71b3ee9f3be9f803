// SPDX-License-Identifier: MIT
#include "begin.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

static void secure_streams(void) {
    FILE *const streams[] = {stdin, stdout, stderr};
    (void)signal(SIGPIPE, SIG_IGN);
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++) {
        if (fcntl(fd, F_GETFD) < 0 && freopen("/dev/null", "r+", streams[fd]) == NULL) {
            return; // Without /dev/null there are worse problems.
        }
    }
}

int begin_program(const char *program, int count, char **arguments) {
    secure_streams();
    for (int i = 1; i < count; i++) {
        if (arguments[i][0] == '\0') {
            (void)fprintf(stderr,
                          "%s: argument %d is empty; leave it out, or set the variable that it comes from; see %s "
                          "--help\n",
                          program, i, program);
            return EX_USAGE;
        }
        if (strcmp(arguments[i], "--") == 0) {
            (void)fprintf(stderr, "%s: -- means nothing here; leave it out; see %s --help\n", program, program);
            return EX_USAGE;
        }
    }
    return 0;
}

bool begin_is_value(const char *program, const char *value) {
    if (value == NULL || value[0] != '-' || value[1] == '\0') {
        return true;
    }
    (void)fprintf(stderr, "%s: the option before %.100s needs a value; see %s --help\n", program, value, program);
    return false;
}
