// SPDX-License-Identifier: MIT
/// The floor of a command: reads a line of two numbers from its only client and writes both setpoints.
/// usage: floor_line INTERFACE SOCKET
#include "timed.h"

#include <stdlib.h>
#include <unistd.h>

int main(int argc, char **argv) {
    const int can = timed_can((argc == 3) ? argv[1] : "", CAN_INV_FILTER);
    const int client = timed_accept(argv[2]);
    char line[256];
    for (ssize_t length; (length = read(client, line, sizeof line - 1U)) > 0;) {
        char *rest;
        line[length] = '\0';
        const long left = strtol(line, &rest, 10);
        timed_send_pair(can, (int16_t)left, (int16_t)strtol(rest, NULL, 10));
    }
    return 0;
}
