// SPDX-License-Identifier: MIT
/// Sends two lines alternately, each in the pause after a pair, and prints the time in nanoseconds until a frame follows.
/// usage: ask_line INTERFACE SOCKET COUNT LINE_A LINE_B [FIRST_LINE]   FIRST_LINE: to be answered with ok before the others
#include "timed.h"

#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/// Later than the shortest spacing of pairs, and well before the next pair of a period is due.
#define PAUSE_NS   8000000
#define PERIOD_ms  19
#define LINE_BYTES 512
#define REPLY_ms   3000
/// Time between two attempts to arm.
#define REST_ms 100

static void send_line(int client, const char *words) {
    char line[LINE_BYTES];
    const int length = snprintf(line, sizeof line, "%s\n", words);
    (void)timed_need((int)send(client, line, (size_t)length, MSG_NOSIGNAL), "send");
}

/// Returns false if the wheels still turn after an earlier measurement.
static bool receive_ok(int client) {
    static char answer[65536];
    size_t length = 0;
    struct pollfd ready = {.fd = client, .events = POLLIN};
    do {
        const ssize_t more =
            (poll(&ready, 1, REPLY_ms) > 0) ? read(client, &answer[length], sizeof answer - 1U - length) : 0;
        length += (more > 0) ? (size_t)more : 0U;
        answer[length] = '\0';
        if (strstr(answer, "\"error\":\"not_at_rest\"") != NULL) {
            return false;
        }
        if (more <= 0 || strstr(answer, "\"ok\":false") != NULL) {
            (void)fprintf(stderr, "no ok: %s\n", answer);
            exit(1);
        }
    } while (strstr(answer, "\"ok\":true") == NULL);
    return true;
}

/// Repeats the line until the wheels are at standstill, for at most REPLY_ms.
static void ask_until_ok(int client, const char *words) {
    for (int waited_ms = 0; waited_ms < REPLY_ms; waited_ms += REST_ms) {
        send_line(client, words);
        if (receive_ok(client)) {
            return;
        }
        timed_sleep_until_ns(timed_now_ns(CLOCK_MONOTONIC) + REST_ms * INT64_C(1000000));
    }
    timed_fail("the wheels did not come to standstill");
}

static void forget(int can, int client) {
    char waste[65536];
    struct can_frame frame;
    while (recv(client, waste, sizeof waste, MSG_DONTWAIT) > 0) {
    }
    while (recv(can, &frame, sizeof frame, MSG_DONTWAIT) > 0) {
    }
}

/// Waits for the next pair, or for a period without one, and then for a pause.
static void wait_for_pause(int can, int client) {
    struct can_frame frame;
    int64_t at_ns;
    (void)timed_receive(can, TIMED_LEFT, &frame, &at_ns, PERIOD_ms);
    timed_sleep_until_ns(timed_now_ns(CLOCK_MONOTONIC) + PAUSE_NS);
    forget(can, client);
}

int main(int argc, char **argv) {
    const int can = timed_can((argc >= 6) ? argv[1] : "", TIMED_LEFT);
    const int client = timed_connect(argv[2]);
    timed_ask_for_stamps(can);
    if (argc > 6) {
        ask_until_ok(client, argv[6]);
    }
    for (long i = atol(argv[3]); i > 0; i--) {
        struct can_frame frame;
        int64_t at_ns;
        wait_for_pause(can, client);
        const int64_t asked_ns = timed_now_ns(CLOCK_REALTIME);
        send_line(client, argv[4 + i % 2]);
        if (!timed_receive(can, TIMED_LEFT, &frame, &at_ns, REPLY_ms)) {
            timed_fail("no frame followed");
        }
        (void)printf("%lld\n", (long long)(at_ns - asked_ns));
    }
    return 0;
}
