// SPDX-License-Identifier: MIT
/// A bridge as a service: how it waits and ends, and its messages to the service manager. Without NOTIFY_SOCKET there
/// are no messages.
#ifndef BRIDGE_SERVICE_H
#define BRIDGE_SERVICE_H

#include <poll.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct {
    int fd;            ///< -1: no service manager.
    uint64_t every_us; ///< Interval of watchdog messages; 0: no watchdog.
    uint64_t fed_us;
} bridge_service_t;

/// Returns CLOCK_MONOTONIC.
uint64_t bridge_now_us(void);

/// Returns CLOCK_REALTIME since 1970. It is only for display and decides nothing.
int64_t bridge_wall_us(void);

/// After this call SIGTERM and SIGINT arrive only while `bridge_service_wait` waits. Call it before creating a thread,
/// because threads inherit the mask.
void bridge_service_take_signals(void);

/// Waits like poll. Returns false if a signal requested the end, before or during the call.
bool bridge_service_wait(struct pollfd *fds, unsigned count, int wait_ms);

/// Reads NOTIFY_SOCKET and WATCHDOG_USEC from the environment. From now on stderr drops what its reader does not accept
/// immediately (a stopped terminal, a full pipe): a log line must not delay a stop. Call it before the loop.
void bridge_service_open(bridge_service_t *self);

/// Sends a message to the service manager. Never waits.
void bridge_service_notify(const bridge_service_t *self, const char *words);

/// Feeds the watchdog at half its time. Call it only at the end of a complete round of the loop.
void bridge_service_round(bridge_service_t *self, uint64_t now_us);

#endif
