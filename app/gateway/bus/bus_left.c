// SPDX-License-Identifier: MIT
#include "bus_left.h"

#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#define PATH_SIZE 256

void gw_bus_left_sentence(const iw_bus_link_t *link, const char *bus, char *out_sentence, size_t size) {
    static const char what[] = "a setpoint is still in the controller and may leave when wheels get power";
    if (link->presence == IW_LINK_LOCAL) {
        (void)snprintf(out_sentence, size, "bus %s: %s; start its hub (the simulator) again", bus, what);
    } else if (!link->echo_proven) {
        (void)snprintf(out_sentence, size, "bus %s: %s; this adapter gives nothing back: switch it off and on", bus,
                       what);
    } else {
        (void)snprintf(out_sentence, size,
                       "bus %s: %s; empty it: ip link set %s down; ip link set %s up (or let the service do it: "
                       "systemctl enable --now iwheel-can-restart@%s.path)",
                       bus, what, bus, bus, bus);
    }
}

bool gw_bus_left_ask(const char *directory, const char *interface) {
    static const char text[] = "restart\n";
    char path[PATH_SIZE];
    if (snprintf(path, sizeof path, "%s/%s.restart", directory, interface) >= (int)sizeof path) {
        return false;
    }
    (void)unlink(path); // Made anew, so that nothing is written through a link.
    const int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (fd < 0) {
        return false;
    }
    const bool written = write(fd, text, sizeof text - 1U) == (ssize_t)(sizeof text - 1U);
    return (close(fd) == 0) && written;
}
