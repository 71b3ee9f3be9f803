// SPDX-License-Identifier: MIT
/// State of a network interface in the kernel, through netlink (libmnl).
///
/// A request returns with its reply. It may wait while another process configures an interface (see
/// iwl_netdev_presence), so the port makes it only when an interface has come up.
#ifndef IWL_NETLINK_H
#define IWL_NETLINK_H

#include "iwheel/hal.h"
#include "iwheel_linux/bus_link.h"

#include <sys/types.h>

struct mnl_socket;
struct nlmsghdr;

typedef struct {
    struct mnl_socket *socket;
    uint32_t sequence;
} iwl_netlink_t;

typedef struct {
    iwl_bus_link_t link; ///< Without purge, changes, lost and load.
    int index;
    iw_bus_state_t state; ///< IW_BUS_ACTIVE also for an interface without error states.
} iwl_netlink_reading_t;

/// Opens the socket. Returns 0 or an errno. Only this function and `iwl_netlink_open_events` allocate memory.
int iwl_netlink_open(iwl_netlink_t *self);
void iwl_netlink_close(iwl_netlink_t *self);

/// Opens a socket for change events, which becomes readable when an interface has changed. It cannot be used for
/// requests.
int iwl_netlink_open_events(iwl_netlink_t *self);
int iwl_netlink_fd(const iwl_netlink_t *self);

/// Reads all events. Returns true if there was one, of any interface.
bool iwl_netlink_take_events(iwl_netlink_t *self);

/// Reads the state of an interface. Returns 0, also for an interface that does not exist (IWL_LINK_ABSENT), or an
/// errno; then `*out_reading` is absent.
int iwl_netlink_read(iwl_netlink_t *self, const char *name, iwl_netlink_reading_t *out_reading);

/// Brings the interface up or down. Returns 0 or an errno: EPERM without CAP_NET_ADMIN.
int iwl_netlink_set_up(iwl_netlink_t *self, int index, bool up);

/// Parses a message of type RTM_NEWLINK. Pure function. Returns false if it is malformed.
bool iwl_netlink_parse(const struct nlmsghdr *message, iwl_netlink_reading_t *out_reading);

/// Sets an interface down and up again in a separate process: some adapters need seconds for it, and the loop must not
/// wait.
///
///     start --> RUNNING --poll--> ended: 0 done, or an errno
///
/// The process inherits no descriptors, and continues if the gateway ends: it brings the interface up again, and tries
/// that once a second for a minute.
///
/// Result of `poll` while the process runs.
#define IWL_NETLINK_RESTART_RUNNING (-1)

/// Starts the process. Returns 0, or an errno if it cannot be created. `*out_process` is for `poll`.
int iwl_netlink_restart_start(int interface, pid_t *out_process);

/// Returns IWL_NETLINK_RESTART_RUNNING, or once the result: 0 if the interface was down and is up again, otherwise an
/// errno. EPERM: CAP_NET_ADMIN is missing, and nothing was done.
int iwl_netlink_restart_poll(pid_t process);

/// Queries about a network interface that do not wait: none of them uses the kernel's lock on interface configuration
/// (RTNL), which another process may hold for seconds (for example while it sets up an adapter that does not answer).
///
/// Returns whether the interface is present and up. `fd`: any socket. Writes `*out_index` unless it is absent. An
/// interface counts as up only when its setup is complete.
iwl_link_presence_t iwl_netdev_presence(int fd, const char *name, int *out_index);

/// Returns 1 if the controller participates in the bus, 0 if not (for a CAN controller that is up: bus-off), < 0 if
/// unknown.
int iwl_netdev_carrier(const char *name);

#endif
