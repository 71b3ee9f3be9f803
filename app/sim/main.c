// SPDX-License-Identifier: MIT
#include "simulator.h"

#include "begin/begin.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sysexits.h>
#include <unistd.h>

#define ANSWER_WITHIN_S 2

/// Returns true if the answer is complete. The answer to `help` ends in a line with a single dot, every other answer at
/// its first newline.
static bool complete(const char *answer, size_t length, bool help) {
    if (!help || strncmp(answer, "error", 5U) == 0) {
        return memchr(answer, '\n', length) != NULL;
    }
    return length >= 3U && memcmp(&answer[length - 3U], "\n.\n", 3U) == 0;
}

static int receive(int fd, bool help) {
    char answer[SIM_ANSWER_BYTES + 1U];
    size_t used = 0U;
    while (!complete(answer, used, help) && used < sizeof answer - 1U) {
        ssize_t const length = recv(fd, &answer[used], sizeof answer - 1U - used, 0);
        if (length <= 0) {
            (void)fprintf(stderr, "iwheel-sim: the running simulator did not answer\n");
            return EX_TEMPFAIL;
        }
        used += (size_t)length;
    }
    answer[(help && used >= 2U) ? used - 2U : used] = '\0';
    (void)fputs(answer, stdout);
    return (strncmp(answer, "error", 5U) == 0) ? 1 : EX_OK;
}

/// Sends one command to a running simulator and prints the answer. Returns the exit code: 0 ok, 1 refused, 69 no
/// simulator, 75 no answer.
static int send_command(const char *control_path, const char *command) {
    char line[SIM_LINE_BYTES + 1U];
    struct timeval const limit = {.tv_sec = ANSWER_WITHIN_S};
    int const length = snprintf(line, sizeof line, "%s\n", command);
    int const fd = sim_listener_connect(control_path, SOCK_STREAM);
    if (fd < 0) {
        (void)fprintf(stderr, "iwheel-sim: %s: %s; is a simulator running? Its --control must be the same\n",
                      control_path, strerror(errno));
        return EX_UNAVAILABLE;
    }
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    bool const sent = send(fd, line, (size_t)length, MSG_NOSIGNAL) == (ssize_t)length;
    int const result = sent ? receive(fd, strcmp(command, "help") == 0) : EX_UNAVAILABLE;
    (void)close(fd);
    return result;
}

int main(int argc, char **argv) {
    static sim_simulator_t simulator;
    sim_options_t options;
    int result = begin_program("iwheel-sim", argc, argv);
    if (result != 0) {
        return result;
    }
    result = sim_options_read(&options, argc, argv);
    if (result >= 0) {
        return result;
    }
    if (options.command[0] != '\0') {
        return send_command(options.control_path, options.command);
    }
    result = sim_simulator_open(&simulator, &options);
    if (result >= 0) {
        return result;
    }
    sim_simulator_run(&simulator);
    sim_simulator_close(&simulator);
    return EX_OK;
}
