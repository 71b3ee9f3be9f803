// SPDX-License-Identifier: MIT
/// Ensures one gateway per bus, for every user and every socket, and that foreign processes cannot prevent it.
///
/// There are two locks. A gateway acquires both as far as it has the rights, and both end with the process:
///
/// - a file that only root and the service can open (for an interface in the runtime directory, with the network
///   namespace in its name; for a local bus next to its path): no foreign process can hold it
/// - a name that all processes in the network namespace can read (bus_names.h): for gateways that cannot open the file
///
/// A process that has one of them and may not run a gateway (owners.h) is reported, but does not prevent the start. One
/// owner, one thread.
#ifndef GATEWAY_BUS_LOCK_H
#define GATEWAY_BUS_LOCK_H

#include "bus_names.h"

#include "iwheel/types.h"

#define GW_BUS_LOCK_PATH_SIZE (SOCK_ADDRESS_SIZE + 48U)
/// Interval of checks for another gateway.
#define GW_BUS_LOCK_POLL_US 1000000U

typedef struct {
    gw_bus_names_t names;
    gw_holder_t holder;      ///< Process that has the lock instead.
    gw_holder_t stranger[2]; ///< Foreign processes that have the file or a name; empty names if there are none.
    char path[GW_BUS_LOCK_PATH_SIZE];
    int fd;    ///< Descriptor of the file; -1 if it must not be opened.
    int error; ///< Errno of the reason.
    iw_time_us_t poll_us;
} gw_bus_lock_t;

/// Acquires the lock of the bus with this configured name. Returns 0 or an errno; EWOULDBLOCK: another process has it.
int gw_bus_lock_take(gw_bus_lock_t *self, const char *bus, const char *directory);

/// Checks the lock once per cycle. Returns true if this gateway must leave the bus to `self->holder`.
bool gw_bus_lock_poll(gw_bus_lock_t *self, iw_time_us_t now_us);

void gw_bus_lock_release(gw_bus_lock_t *self);

/// Returns the path of a local bus; NULL for the name of an interface.
const char *gw_bus_lock_local_path(const char *bus);

#endif
