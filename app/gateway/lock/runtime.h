// SPDX-License-Identifier: MIT
/// What the gateway leaves behind while it runs: the lock of its bus, and the marker that tells a later start of a
/// crash.
///
/// The marker is named after the bus, and every gateway on that bus must find it, wherever its socket lies. For an
/// interface it is in a directory all gateways share or, for those who may not write there, beside their own socket:
/// it is looked for in both. For `unix:PATH` it is beside PATH. A file that a stranger has put there (owners.h) is none.
#ifndef GATEWAY_RUNTIME_H
#define GATEWAY_RUNTIME_H

#include "bus_lock.h"

#include <stdio.h>

#define GW_RUNTIME_PATH_SIZE (SOCK_PATH_SIZE + SOCK_ADDRESS_SIZE + 16U)
#define GW_RUNTIME_PLACES    2U

typedef struct {
    gw_bus_lock_t lock;
    char place[GW_RUNTIME_PLACES][GW_RUNTIME_PATH_SIZE]; ///< Where the marker may be, the best first; empty: no place.
    const char *directory;                               ///< Of the first place, if it may be made; else NULL.
    const char *marker_path;                             ///< Where it is, or where the last change failed.
    bool marked;                                         ///< It is there, as far as we know.
    bool unsure;                                         ///< The last change failed.
} gw_runtime_t;

/// Takes the lock of `bus` and looks for the marker, also beside `socket`. `directory` is SOCK_RUNTIME_DIRECTORY but in tests, and must outlive
/// `self`. 0, or a sysexits code after the cause and the cure have been printed on `err`; a stranger who holds what locks the
/// bus is printed there too.
int gw_runtime_open(gw_runtime_t *self, const char *bus, const char *socket, const char *directory, FILE *err);

/// Releases the lock. The marker stays as it is.
void gw_runtime_close(gw_runtime_t *self);

/// True if the process before us died while it was sending.
bool gw_runtime_crashed(const gw_runtime_t *self);

/// Sets or removes the marker, once per change. False if that failed; the next call tries again. Does not wait for a disk: its
/// directory is meant to be in memory.
bool gw_runtime_mark(gw_runtime_t *self, bool sending);

#endif
