// SPDX-License-Identifier: MIT
/// What a bridge tells the service manager: ready, stopping, and that its loop is alive. Without NOTIFY_SOCKET nothing happens. Never waits.
#ifndef IW_BRIDGE_SERVICE_H
#define IW_BRIDGE_SERVICE_H

#include <stdint.h>

typedef struct {
    int fd;            ///< -1: nobody wants to know.
    uint64_t every_us; ///< 0: no watchdog is asked for.
    uint64_t fed_us;
} bridge_service_t;

/// CLOCK_MONOTONIC.
uint64_t bridge_now_us(void);

/// Reads NOTIFY_SOCKET and WATCHDOG_USEC from the environment.
void bridge_service_open(bridge_service_t *self);
void bridge_service_tell(const bridge_service_t *self, const char *words);

/// Feeds the watchdog at half its time. Call it at the end of a complete round of the loop, and nowhere else.
void bridge_service_round(bridge_service_t *self, uint64_t now_us);

#endif
