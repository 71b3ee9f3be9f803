// SPDX-License-Identifier: MIT
/// The kernel's view of a network interface, through netlink (libmnl).
///
/// A request is answered within the call. It may have to wait while a network interface is being configured elsewhere
/// (see iwl_netdev_presence), so it is made only when an interface has come up.
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
    iw_bus_state_t state; ///< IW_BUS_ACTIVE too if the interface has no error states.
} iwl_netlink_reading_t;

/// 0, or an errno. This and `iwl_netlink_open_events` are the only calls that allocate.
int iwl_netlink_open(iwl_netlink_t *self);
void iwl_netlink_close(iwl_netlink_t *self);

/// The same for change events: `self` then becomes readable whenever some interface has changed. Not for requests.
int iwl_netlink_open_events(iwl_netlink_t *self);
int iwl_netlink_fd(const iwl_netlink_t *self);

/// Takes all events. True if there were any, of whichever interface.
bool iwl_netlink_take_events(iwl_netlink_t *self);

/// 0 also for an interface that does not exist (IWL_LINK_ABSENT); else an errno, `*out_reading` then is absent.
int iwl_netlink_read(iwl_netlink_t *self, const char *name, iwl_netlink_reading_t *out_reading);

/// Takes the interface up or down. 0, or an errno: EPERM without CAP_NET_ADMIN.
int iwl_netlink_set_up(iwl_netlink_t *self, int index, bool up);

/// What one message of type RTM_NEWLINK says. Pure function. False if it is malformed.
bool iwl_netlink_parse(const struct nlmsghdr *message, iwl_netlink_reading_t *out_reading);

/// Takes an interface down and up again, in a process of its own: with some adapters that takes seconds, and the loop
/// must not wait for it.
///
///     start --> RUNNING --poll--> ended: 0 done, or why not
///
/// The process holds nothing of ours, and goes on if we end: an interface that it has taken down it brings up again,
/// trying once a second for a minute.
///
/// What `poll` answers while the process is at work.
#define IWL_NETLINK_RESTART_RUNNING (-1)

/// 0, or an errno if no process can be made. `*out_process` is for `poll`.
int iwl_netlink_restart_start(int interface, pid_t *out_process);

/// IWL_NETLINK_RESTART_RUNNING; or, once, how it ended: 0 the interface was down and is up again, else an errno: EPERM
/// without CAP_NET_ADMIN, nothing was done then.
int iwl_netlink_restart_poll(pid_t process);

/// State of a network interface, read without waiting: none of these takes the kernel's lock on interface configuration
/// (RTNL), which others may hold for seconds (while an adapter that does not answer is being set up, for example).
///
/// Whether the interface is there and up. `fd`: any socket. `*out_index` is written unless it is absent. An interface
/// is seen as up only after the work of setting it up is done.
iwl_link_presence_t iwl_netdev_presence(int fd, const char *name, int *out_index);

/// 1: its controller takes part in the bus. 0: it does not; for a CAN controller that is up: bus-off. < 0: unknown.
int iwl_netdev_carrier(const char *name);

#endif
