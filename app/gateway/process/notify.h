// SPDX-License-Identifier: MIT
/// What the service manager is told: ready, stopping, and that the loop is alive. One datagram each to the socket it
/// names in NOTIFY_SOCKET; without one nothing happens. Never waits.
#ifndef GATEWAY_NOTIFY_H
#define GATEWAY_NOTIFY_H

#include "iwheel/types.h"

#include <sys/socket.h>
#include <sys/un.h>

typedef struct {
    struct sockaddr_un address;
    socklen_t address_length;
    iw_time_us_t every_us; ///< IW_NEVER: no watchdog is asked for.
    iw_time_us_t fed_us;
    int fd; ///< -1: nobody wants to know.
} gw_notify_t;

/// Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID from the environment.
void gw_notify_open(gw_notify_t *self);
void gw_notify_close(gw_notify_t *self);

void gw_notify_ready(const gw_notify_t *self);
void gw_notify_stopping(const gw_notify_t *self);

/// Feeds the watchdog at half its time. Call it at the end of a complete cycle (bus, e-stop and clients served), and
/// nowhere else.
void gw_notify_cycle(gw_notify_t *self, iw_time_us_t now_us);

#endif
