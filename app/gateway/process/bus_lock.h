// SPDX-License-Identifier: MIT
/// One gateway per bus, whoever starts it and wherever its socket lies.
///
/// An interface of the kernel is locked by an abstract unix socket named after it: like the interface it belongs to
/// the network namespace, needs no directory, and goes with the process. A local bus is locked by a file beside its
/// path. One owner, one thread.
#ifndef GATEWAY_BUS_LOCK_H
#define GATEWAY_BUS_LOCK_H

#include "gateway_config.h"

#include <sys/types.h>

#define GW_BUS_LOCK_NAME_SIZE (GATEWAY_ADDRESS_SIZE + 16U)

typedef struct {
    char name[GW_BUS_LOCK_NAME_SIZE]; ///< For people: a path, or the socket's name behind an `@`.
    pid_t holder;                     ///< Who has it instead of us; 0: not known.
    int fd;                           ///< -1: we do not hold it.
} gw_bus_lock_t;

/// Takes the lock of the bus as it is named in the configuration. 0, or an errno; EWOULDBLOCK: somebody else has it.
int gw_bus_lock_take(gw_bus_lock_t *self, const char *bus);

void gw_bus_lock_release(gw_bus_lock_t *self);

/// The path of a local bus; NULL if the name is that of an interface.
const char *gw_bus_lock_local_path(const char *bus);

#endif
