// SPDX-License-Identifier: MIT
/// Takes an interface down and up again, in a process of its own: with some adapters that takes seconds, and the loop
/// must not wait for it.
///
///     start --> RUNNING --poll--> ended: 0 done, or why not
///
/// The process holds nothing of ours, and goes on if we end: an interface that it has taken down it brings up again,
/// trying once a second for a minute.
#ifndef IW_NETLINK_RESTART_H
#define IW_NETLINK_RESTART_H

#include <sys/types.h>

/// What `poll` answers while the process is at work.
#define IW_NETLINK_RESTART_RUNNING (-1)

/// 0, or an errno if no process can be made. `*out_process` is for `poll`.
int iw_netlink_restart_start(int interface, pid_t *out_process);

/// IW_NETLINK_RESTART_RUNNING; or, once, how it ended: 0 the interface was down and is up again, else an errno: EPERM
/// without CAP_NET_ADMIN, nothing was done then.
int iw_netlink_restart_poll(pid_t process);

#endif
