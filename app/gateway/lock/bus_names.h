// SPDX-License-Identifier: MIT
/// Names of the network namespace under which gateways find each other: abstract unix sockets. They need no directory,
/// cross mount namespaces, and go with the process.
///
/// Anybody may take any name, so a name says nothing; who holds it does, by the kernel's word. A gateway takes the first
/// free one of its places and then looks at the places of everybody who may run one:
///
///     place 0       KEY          everybody's
///     places 1..3   KEY/UID/n    of that user, for when strangers hold those before
///
/// Of two that see each other the one whose place comes first goes on. The other withdraws at once, but one that came
/// later than the decision stays: so the first waits a moment before it believes that it must withdraw instead.
#ifndef GATEWAY_BUS_NAMES_H
#define GATEWAY_BUS_NAMES_H

#include "sockets/owners.h"

/// Longest name with its terminator: that of a socket's address.
#define GW_BUS_NAME_SIZE 108U
#define GW_BUS_KEY_SIZE  64U
#define GW_BUS_PLACES    4U
/// So long for the other to withdraw, or to say who it is.
#define GW_BUS_PATIENCE_US 200000U

/// Who holds a name or a file.
typedef struct {
    char name[GW_BUS_NAME_SIZE + 16U]; ///< For people; empty: nobody does.
    uid_t uid;                         ///< (uid_t)-1: nobody knows.
    pid_t pid;                         ///< 0: not known.
} gw_holder_t;

typedef struct {
    char key[GW_BUS_KEY_SIZE]; ///< What all names of this bus begin with, with an `@` for the zero byte.
    sock_owners_t owners;
    unsigned place; ///< GW_BUS_PLACES: all of ours were taken.
    int fd;         ///< -1: no name.
} gw_bus_names_t;

/// Takes a name. 0, EWOULDBLOCK if somebody who may run a gateway serves this bus (`*out_holder`), or another errno.
/// `*out_stranger` is somebody who may not and holds a name all the same. Waits GW_BUS_PATIENCE_US at the most.
int gw_bus_names_take(gw_bus_names_t *self, gw_holder_t *out_holder, gw_holder_t *out_stranger);

/// Lets go those who asked who we are. True, with `*out_holder`, if we are neither root nor the service and one of these
/// has come: it does not wait for us. A few system calls; never waits.
bool gw_bus_names_poll(gw_bus_names_t *self, gw_holder_t *out_holder);

void gw_bus_names_release(gw_bus_names_t *self);

#endif
