// SPDX-License-Identifier: MIT
/// Reads an event `state` through libiwheel-client again and again, for a counter of instructions.
///
///     bench_client FILE ROUNDS [fields]    FILE: the event as one line, as `bench_status line` prints it; fields: reads its fields too
///
/// The integers of the event change from round to round, as those of a gateway do. Two runs with different ROUNDS differ
/// only in the changing and the reading. Exit status 1 if the client does not read each event.
#include "iwheel_client/client.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define DIGITS_MAX 256U

static const char hello[] = "{\"event\":\"hello\",\"api\":1,\"client\":3}\n";

/// Last digits of the integers of an event.
typedef struct {
    char *at[DIGITS_MAX];
    unsigned count;
} digits_t;

/// Finds the last digit of each integer of two digits or more that is a whole value. The assumptions do not change, so it
/// ends at them.
static digits_t find_digits(char *line) {
    digits_t digits = {.count = 0};
    const char *const end = strstr(line, "\"ledger\":");
    for (char *c = strchr(line, ':'); c != NULL && c < end && digits.count < DIGITS_MAX; c = strchr(c, ':')) {
        const size_t length = strspn(++c, "0123456789");
        if (length > 1U && strchr(",}", c[length]) != NULL) {
            digits.at[digits.count++] = &c[length - 1U];
        }
    }
    return digits;
}

static bool read_events(iwc_t *client, int gateway, char *line, unsigned rounds, bool fields) {
    const size_t length = strlen(line);
    const digits_t digits = find_digits(line);
    iwc_message_t event;
    iwc_state_t state;
    for (unsigned i = 0; i < rounds; i++) {
        for (unsigned k = 0; k < digits.count; k++) {
            *digits.at[k] = (char)('0' + i % 10U);
        }
        if (write(gateway, line, length) != (ssize_t)length || iwc_next(client, 0, &event) != IWC_OK ||
            !event.is_event || (fields && !iwc_state(client, &event, &state))) {
            return false;
        }
    }
    return true;
}

int main(int argc, char **argv) {
    static char line[IWC_LINE_MAX + 2U];
    int pair[2];
    FILE *file = (argc >= 3) ? fopen(argv[1], "re") : NULL;
    iwc_t *client = iwc_new();
    if (file == NULL || client == NULL || fgets(line, sizeof line, file) == NULL ||
        socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0 ||
        write(pair[1], hello, sizeof hello - 1U) != (ssize_t)(sizeof hello - 1U) ||
        iwc_adopt(client, pair[0], 1000) != IWC_OK) {
        return 1;
    }
    return read_events(client, pair[1], line, (unsigned)strtoul(argv[2], NULL, 10), argc == 4) ? 0 : 1;
}
