// SPDX-License-Identifier: MIT
/// One gateway per bus, whoever starts it and wherever its socket lies, and no stranger in its way.
///
/// Two locks, and a gateway holds what it can of both; both go with the process:
///
/// - a file that only root and the service can open (an interface's in the runtime directory, named after the network
///   namespace too; a local bus's beside its path): no stranger can hold it
/// - a name that everybody in the network namespace can look up (bus_names.h): for gateways that may not open the file
///
/// Whoever holds one of them and may not run a gateway (owners.h) is noted, and does not keep us from starting. One owner,
/// one thread.
#ifndef GATEWAY_BUS_LOCK_H
#define GATEWAY_BUS_LOCK_H

#include "bus_names.h"

#include "iwheel/types.h"

#define GW_BUS_LOCK_PATH_SIZE (SOCK_ADDRESS_SIZE + 48U)
/// Who may have come is looked at this often.
#define GW_BUS_LOCK_LOOK_US 1000000U

typedef struct {
    gw_bus_names_t names;
    gw_holder_t holder;      ///< Who has it instead of us.
    gw_holder_t stranger[2]; ///< Who has the file, and a name, and may not; empty names: nobody.
    char path[GW_BUS_LOCK_PATH_SIZE];
    int fd;    ///< Of the file; -1: we may not have it.
    int error; ///< Why not.
    iw_time_us_t look_us;
} gw_bus_lock_t;

/// Takes the lock of the bus as it is named in the configuration. 0, or an errno; EWOULDBLOCK: somebody else has it.
int gw_bus_lock_take(gw_bus_lock_t *self, const char *bus, const char *directory);

/// Once per cycle. True if we must give the bus to `self->holder`.
bool gw_bus_lock_poll(gw_bus_lock_t *self, iw_time_us_t now_us);

void gw_bus_lock_release(gw_bus_lock_t *self);

/// The path of a local bus; NULL if the name is that of an interface.
const char *gw_bus_lock_local_path(const char *bus);

#endif
