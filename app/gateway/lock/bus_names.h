// SPDX-License-Identifier: MIT
/// Names in the network namespace by which gateways find each other: abstract unix sockets. They need no directory, are
/// visible across mount namespaces, and end with the process.
///
/// Every process may use any name, so only the identity of its holder counts, which the kernel reports. A gateway
/// acquires the first free one of its places, and then checks the places of all users who may run a gateway:
///
///     place 0       KEY          for all users
///     places 1..3   KEY/UID/n    for one user, if foreign processes hold the places before
///
/// If two gateways see each other, the one with the earlier place continues and the other withdraws immediately. A
/// gateway that arrived after that decision stays, so the first one waits before it concludes that it must withdraw.
#ifndef GATEWAY_BUS_NAMES_H
#define GATEWAY_BUS_NAMES_H

#include "sockets/owners.h"

/// Size of a name with its terminator: that of a socket address.
#define GW_BUS_NAME_SIZE 108U
#define GW_BUS_KEY_SIZE  64U
#define GW_BUS_PLACES    4U
/// Time for the other gateway to withdraw, or to identify itself.
#define GW_BUS_PATIENCE_US 200000U

/// Holder of a name or a file.
typedef struct {
    char name[GW_BUS_NAME_SIZE + 16U]; ///< Description for messages; empty if there is none.
    uid_t uid;                         ///< (uid_t)-1 if unknown.
    pid_t pid;                         ///< 0 if unknown.
} gw_holder_t;

typedef struct {
    char key[GW_BUS_KEY_SIZE]; ///< Prefix of all names of this bus, with `@` for the zero byte.
    sock_owners_t owners;
    unsigned place; ///< GW_BUS_PLACES if no place was free.
    int fd;         ///< Socket of the name; -1 if there is none.
} gw_bus_names_t;

/// Acquires a name. Returns 0, EWOULDBLOCK if a process that may run a gateway serves this bus (`*out_holder`), or another
/// errno. `*out_stranger` is a process that may not and has a name. Call it before anything is sent: it waits for
/// GW_BUS_PATIENCE_US at most, and for up to 50 ms for each name whose holder accepts no connection, because foreign
/// processes can make the kernel's list of sockets long.
int gw_bus_names_take(gw_bus_names_t *self, gw_holder_t *out_holder, gw_holder_t *out_stranger);

/// Answers processes that query this one's identity. Returns true and sets `*out_holder` if this process is neither
/// root nor the service and one of these has a name: that one does not wait.
///
/// At most ten connections, and 64 that are answered; never waits and never reads the kernel's list. A holder whose queue
/// of connections is full is unknown and changes nothing; a later call finds it. Until then each gateway detects the
/// other one on the bus (cause `second_master`).
bool gw_bus_names_poll(gw_bus_names_t *self, gw_holder_t *out_holder);

void gw_bus_names_release(gw_bus_names_t *self);

#endif
