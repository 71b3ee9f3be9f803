// SPDX-License-Identifier: MIT
/// The event loop: one thread, one wait, bounded work per cycle. See daemon.h for the order of a cycle.
#ifndef GATEWAY_LOOP_H
#define GATEWAY_LOOP_H

struct gw_daemon;

/// Opens epoll, timer and signal descriptors and watches everything the daemon has open. SIGTERM, SIGINT and SIGHUP
/// are then read by the loop and nowhere else. 0 or an errno.
int gw_loop_open(struct gw_daemon *daemon);
void gw_loop_close(struct gw_daemon *daemon);

/// Runs until a signal has asked for the end and the wheels have been brought to a stop. 0, or an errno if waiting
/// itself failed.
int gw_loop_run(struct gw_daemon *daemon);

#endif
