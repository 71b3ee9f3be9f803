// SPDX-License-Identifier: MIT
/// Reads an event `state` through libiwheel-client again and again, for a counter of instructions.
///
///     bench_client FILE ROUNDS [fields]    FILE: the event as one line, as `bench_status line` prints it; fields: reads its fields too
///
/// Two runs with different ROUNDS differ only in the reading. Exit status 1 if the client does not read each event.
#include "iwheel_client/client.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const char hello[] = "{\"event\":\"hello\",\"api\":1,\"client\":3}\n";

static bool read_events(iwc_t *client, int gateway, const char *line, unsigned rounds, bool fields) {
    const size_t length = strlen(line);
    iwc_message_t event;
    iwc_state_t state;
    for (unsigned i = 0; i < rounds; i++) {
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
