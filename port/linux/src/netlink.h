// SPDX-License-Identifier: MIT
/// The kernel's view of a network interface, through netlink (libmnl).
///
/// A request is answered within the call. It may have to wait while a network interface is being configured elsewhere
/// (see netdev.h), so it is made only when an interface has come up.
#ifndef IW_NETLINK_H
#define IW_NETLINK_H

#include "iwheel/hal.h"
#include "iwheel_linux/bus_link.h"

struct mnl_socket;
struct nlmsghdr;

typedef struct {
    struct mnl_socket *socket;
    uint32_t sequence;
} iw_netlink_t;

typedef struct {
    iw_bus_link_t link; ///< Without purge, changes, lost and load.
    int index;
    iw_bus_state_t state; ///< IW_BUS_ACTIVE too if the interface has no error states.
} iw_netlink_reading_t;

/// 0, or an errno. This and `iw_netlink_open_events` are the only calls that allocate.
int iw_netlink_open(iw_netlink_t *self);
void iw_netlink_close(iw_netlink_t *self);

/// The same for change events: `self` then becomes readable whenever some interface has changed. Not for requests.
int iw_netlink_open_events(iw_netlink_t *self);
int iw_netlink_fd(const iw_netlink_t *self);

/// Takes all events. True if there were any, of whichever interface.
bool iw_netlink_take_events(iw_netlink_t *self);

/// 0 also for an interface that does not exist (IW_LINK_ABSENT); else an errno, `*out_reading` then is absent.
int iw_netlink_read(iw_netlink_t *self, const char *name, iw_netlink_reading_t *out_reading);

/// Takes the interface up or down. 0, or an errno: EPERM without CAP_NET_ADMIN.
int iw_netlink_set_up(iw_netlink_t *self, int index, bool up);

/// What one message of type RTM_NEWLINK says. Pure function. False if it is malformed.
bool iw_netlink_parse(const struct nlmsghdr *message, iw_netlink_reading_t *out_reading);

#endif
