// SPDX-License-Identifier: MIT
/// One event loop: descriptors with handlers, and one wake-up time on CLOCK_MONOTONIC.
///
/// A handler belongs to a watch that its owner embeds in its own struct; nothing is allocated. Any handler may remove
/// any watch and close its descriptor, so a handler must bear being called with `fd` -1 or with nothing to read.
#ifndef SIM_LOOP_H
#define SIM_LOOP_H

#include "iwheel/types.h"

#include <stddef.h>
#include <sys/types.h>
#include <sys/un.h>

typedef struct sim_watch {
    void (*ready)(struct sim_watch *watch); ///< Something can be read, or the other end is gone.
    void *owner;
    int fd;
} sim_watch_t;

typedef struct {
    int epoll_fd;
    int timer_fd;
} sim_loop_t;

/// CLOCK_MONOTONIC in microseconds.
iw_time_us_t sim_loop_clock_us(void);

/// False, with errno, if the system refuses.
bool sim_loop_open(sim_loop_t *self);

/// `watch` must be filled in and stay where it is until removed. False, with errno, if the system refuses.
bool sim_loop_add(const sim_loop_t *self, sim_watch_t *watch);
void sim_loop_remove(const sim_loop_t *self, const sim_watch_t *watch);

/// Removes it and closes its descriptor: `fd` is -1 then.
void sim_loop_drop(const sim_loop_t *self, sim_watch_t *watch);

/// Waits for the next event or until `wake_us` (IW_NEVER: for events only) and calls `before`, then the handlers of
/// what is ready.
void sim_loop_wait(const sim_loop_t *self, iw_time_us_t wake_us, void (*before)(void *context), void *context);

// --- a unix socket that others connect to, made and removed with care --------------------------------------------

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
