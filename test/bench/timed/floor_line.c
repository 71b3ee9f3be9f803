// SPDX-License-Identifier: MIT
/// The floor of a command: reads a line of two numbers from the one client there is and writes both setpoints.
/// usage: floor_line INTERFACE SOCKET
#include "timed.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static int accept_one(const char *path) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int listener = timed_need(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket");
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    (void)timed_need(bind(listener, (const struct sockaddr *)&address, sizeof address), path);
    (void)timed_need(listen(listener, 1), path);
    return timed_need(accept(listener, NULL, NULL), path);
}

int main(int argc, char **argv) {
    const int can = timed_can((argc == 3) ? argv[1] : "", CAN_INV_FILTER);
    const int client = accept_one(argv[2]);
    char line[256];
    for (ssize_t length; (length = read(client, line, sizeof line - 1U)) > 0;) {
        char *rest;
        line[length] = '\0';
        const long left = strtol(line, &rest, 10);
        timed_send_pair(can, (int16_t)left, (int16_t)strtol(rest, NULL, 10));
    }
    return 0;
}
