// SPDX-License-Identifier: MIT
/// State of a network interface, read without waiting: none of these takes the kernel's lock on interface configuration
/// (RTNL), which others may hold for seconds (while an adapter that does not answer is being set up, for example).
#ifndef IW_NETDEV_H
#define IW_NETDEV_H

#include "iwheel_linux/bus_link.h"

/// Whether the interface is there and up. `fd`: any socket. `*out_index` is written unless it is absent. An interface
/// is seen as up only after the work of setting it up is done.
iw_link_presence_t iw_netdev_presence(int fd, const char *name, int *out_index);

/// 1: its controller takes part in the bus. 0: it does not; for a CAN controller that is up: bus-off. < 0: unknown.
int iw_netdev_carrier(const char *name);

#endif
