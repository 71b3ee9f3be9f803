// SPDX-License-Identifier: MIT
#include "netlink.h"

#include <fcntl.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <stdio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#ifndef ARPHRD_CAN
#define ARPHRD_CAN 280
#endif

/// Makes three queries by name. If the interface disappears in between, each of them reports it as absent.
iwl_link_presence_t iwl_netdev_presence(int fd, const char *name, int *out_index) {
    struct ifreq request = {.ifr_name = ""};
    (void)snprintf(request.ifr_name, sizeof request.ifr_name, "%s", name);
    if (ioctl(fd, SIOCGIFINDEX, &request) != 0) {
        return IWL_LINK_ABSENT;
    }
    const int index = request.ifr_ifindex;
    if (ioctl(fd, SIOCGIFHWADDR, &request) != 0) {
        return IWL_LINK_ABSENT;
    }
    const bool is_can = request.ifr_hwaddr.sa_family == ARPHRD_CAN;
    if (ioctl(fd, SIOCGIFFLAGS, &request) != 0) {
        return IWL_LINK_ABSENT;
    }
    *out_index = index;
    if (!is_can) {
        return IWL_LINK_NOT_CAN;
    }
    return (((unsigned)request.ifr_flags & (unsigned)IFF_UP) != 0U) ? IWL_LINK_UP : IWL_LINK_DOWN;
}

int iwl_netdev_carrier(const char *name) {
    char path[64];
    char digit = '\0';
    (void)snprintf(path, sizeof path, "/sys/class/net/%s/carrier", name);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        return -1;
    }
    // The kernel refuses the read (EINVAL) while the interface is down: unknown.
    const ssize_t size = read(fd, &digit, 1);
    (void)close(fd);
    if (size != 1) {
        return -1;
    }
    return (digit == '1') ? 1 : 0;
}
