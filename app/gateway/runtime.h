// SPDX-License-Identifier: MIT
/// What the gateway leaves in the file system while it runs: a lock per bus, and the marker that tells a later start of a crash.
///
/// Both are named after the bus. For an interface they lie in the directory of the gateway's socket; for `unix:PATH` beside PATH, so
/// that two gateways with different sockets still meet.
#ifndef GATEWAY_RUNTIME_H
#define GATEWAY_RUNTIME_H

#include "gateway_config.h"

#define GW_RUNTIME_PATH_SIZE (GATEWAY_PATH_SIZE + GATEWAY_ADDRESS_SIZE + 16U)

typedef struct {
    char lock_path[GW_RUNTIME_PATH_SIZE];
    char marker_path[GW_RUNTIME_PATH_SIZE];
    int lock_fd;
    bool marked; ///< The marker is there, as far as we know.
} gw_runtime_t;

/// Makes the paths and takes the lock. 0, or a sysexits code after the cause and the cure have been printed on `err`.
int gw_runtime_open(gw_runtime_t *self, const gateway_config_t *config, FILE *err);

/// Releases the lock. The marker stays as it is.
void gw_runtime_close(gw_runtime_t *self);

/// True if the process before us died while it was sending.
bool gw_runtime_crashed(const gw_runtime_t *self);

/// Sets or removes the marker, once per change. False if that failed. Does not wait for a disk: the directory is meant to be in memory.
bool gw_runtime_mark(gw_runtime_t *self, bool sending);

#endif
