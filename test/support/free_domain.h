// SPDX-License-Identifier: MIT
// A DDS domain for one test, as free_domain() of peer.py chooses it.
#ifndef TEST_ROS2_FREE_DOMAIN_H
#define TEST_ROS2_FREE_DOMAIN_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/// Returns a domain from 1 to 100 that no other test on this machine uses while this process runs; 0 if there is none.
static uint32_t free_domain(void) {
    for (uint32_t domain = 1; domain <= 100U; domain++) {
        struct sockaddr_un name = {.sun_family = AF_UNIX};
        const int length = snprintf(&name.sun_path[1], sizeof name.sun_path - 1U, "iwheel-test-domain-%u", domain);
        const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        const size_t size = offsetof(struct sockaddr_un, sun_path) + 1U + (size_t)length;
        if (bind(fd, (const struct sockaddr *)&name, (socklen_t)size) == 0) {
            return domain; // The name is free again when the process has ended.
        }
        (void)close(fd);
    }
    return 0;
}

#endif
