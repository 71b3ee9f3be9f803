// SPDX-License-Identifier: MIT
/// A bridge as a service: how it waits and is ended, and what it tells the service manager. Without NOTIFY_SOCKET nothing is told.
#ifndef BRIDGE_SERVICE_H
#define BRIDGE_SERVICE_H

#include <poll.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct {
    int fd;            ///< -1: nobody wants to know.
    uint64_t every_us; ///< 0: no watchdog is asked for.
    uint64_t fed_us;
} bridge_service_t;

/// CLOCK_MONOTONIC.
uint64_t bridge_now_us(void);

/// CLOCK_REALTIME since 1970: for people, decides nothing.
int64_t bridge_wall_us(void);

/// From here on SIGTERM and SIGINT come only while `bridge_service_wait` waits. Call it before a thread is made: all inherit it.
void bridge_service_take_signals(void);

/// As poll. False: an end has been asked for, before or meanwhile.
bool bridge_service_wait(struct pollfd *fds, unsigned count, int wait_ms);

/// Reads NOTIFY_SOCKET and WATCHDOG_USEC from the environment.
void bridge_service_open(bridge_service_t *self);

/// Never waits.
void bridge_service_tell(const bridge_service_t *self, const char *words);

/// Feeds the watchdog at half its time. Call it at the end of a complete round of the loop, and nowhere else.
void bridge_service_round(bridge_service_t *self, uint64_t now_us);

#endif
