// SPDX-License-Identifier: MIT
/// A unix socket that others connect to, made and removed with care.
#ifndef SIM_LISTENER_H
#define SIM_LISTENER_H

#include "loop.h"

#include <stddef.h>
#include <sys/types.h>
#include <sys/un.h>

typedef struct {
    sim_watch_t watch; ///< `fd` is -1 unless open.
    const sim_loop_t *loop;
    /// Takes a new connection, not blocking, or returns false: it is closed then.
    bool (*admit)(void *owner, int fd);
    void *owner;
    char path[sizeof(((struct sockaddr_un *)0)->sun_path)];
    dev_t device; ///< Of the socket file we made: it is removed only if it is still that one.
    ino_t inode;
} sim_listener_t;

typedef struct {
    char text[256];
} sim_reason_t;

/// `loop`, `admit` and `owner` must be set. Listens at `path` with sockets of `type` (SOCK_STREAM or SOCK_SEQPACKET), mode 0660. A file that is there is
/// replaced only if it is a socket that nobody answers on. False, with cause and cure in `*out_reason`, if that cannot
/// be.
bool sim_listener_open(sim_listener_t *self, const char *path, int type, sim_reason_t *out_reason);

/// Closes, and removes our socket file.
void sim_listener_close(sim_listener_t *self);

/// Connects to a socket that somebody else listens at; -1 with errno. Blocking.
int sim_listener_connect(const char *path, int type);

#endif
