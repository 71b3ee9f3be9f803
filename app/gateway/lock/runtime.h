// SPDX-License-Identifier: MIT
/// Files of a running gateway: the lock of its bus, and the marker that reports a crash to the next start.
///
/// The name of the marker contains the bus. Every gateway on that bus must find it, independent of its socket. For an
/// interface it is in a directory that all gateways share, or next to the socket of a gateway that cannot write there;
/// the gateway searches both. For `unix:PATH` it is next to PATH. A file of a foreign user (owners.h) does not count.
#ifndef GATEWAY_RUNTIME_H
#define GATEWAY_RUNTIME_H

#include "bus_lock.h"

#include <stdio.h>

#define GW_RUNTIME_PATH_SIZE (SOCK_PATH_SIZE + SOCK_ADDRESS_SIZE + 16U)
#define GW_RUNTIME_PLACES    2U

typedef struct {
    gw_bus_lock_t lock;
    char place[GW_RUNTIME_PLACES]
              [GW_RUNTIME_PATH_SIZE]; ///< Possible places of the marker, the best one first; empty if there is none.
    const char *directory;            ///< Directory of the first place, if it may be created; otherwise NULL.
    const char *marker_path;          ///< Path of the marker, or of the last failed change.
    bool marked;                      ///< The marker exists, as far as known.
    bool unsure;                      ///< The last change failed.
} gw_runtime_t;

/// Acquires the lock of `bus` and searches for the marker, also next to `socket`. `directory` is SOCK_RUNTIME_DIRECTORY
/// except in tests, and must exist as long as `self`. Returns 0, or a sysexits code after it has printed cause and fix
/// to `err`. It also prints a foreign process that has the lock.
int gw_runtime_open(gw_runtime_t *self, const char *bus, const char *socket, const char *directory, FILE *err);

/// Releases the lock. The marker is unchanged.
void gw_runtime_close(gw_runtime_t *self);

/// Returns true if the process before this one died while it sent setpoints.
bool gw_runtime_crashed(const gw_runtime_t *self);

/// Sets or removes the marker, once per change. Returns false if that failed; the next call tries again. It does not
/// wait for a disk, because its directory should be in memory.
bool gw_runtime_mark(gw_runtime_t *self, bool sending);

#endif
