// SPDX-License-Identifier: MIT
/// Messages to the service manager: ready, stopping, and alive. Each is one datagram to the socket in NOTIFY_SOCKET;
/// without it nothing is sent. Never waits.
#ifndef GATEWAY_NOTIFY_H
#define GATEWAY_NOTIFY_H

#include "iwheel/types.h"

#include <sys/socket.h>
#include <sys/un.h>

typedef struct {
    struct sockaddr_un address;
    socklen_t address_length;
    iw_time_us_t every_us; ///< Interval; IW_NEVER if there is no watchdog.
    iw_time_us_t fed_us;
    int fd; ///< Descriptor; -1 if there is no receiver.
} gw_notify_t;

/// Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID from the environment.
void gw_notify_open(gw_notify_t *self);
void gw_notify_close(gw_notify_t *self);

void gw_notify_ready(const gw_notify_t *self);
void gw_notify_stopping(const gw_notify_t *self);

/// Feeds the watchdog at half its time. Call it only at the end of a complete cycle (bus, e-stop and clients served).
void gw_notify_cycle(gw_notify_t *self, iw_time_us_t now_us);

#endif
