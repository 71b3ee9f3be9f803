// SPDX-License-Identifier: MIT
/// Event loop: descriptors with handlers, and one wake-up time on CLOCK_MONOTONIC.
///
/// A handler belongs to a watch that its owner embeds in its own struct; nothing is allocated. Any handler may remove
/// any watch and close its descriptor, so a handler must tolerate a call with `fd` -1 or with nothing to read.
#ifndef SIM_LOOP_H
#define SIM_LOOP_H

#include "iwheel/types.h"

#include <stddef.h>
#include <sys/types.h>
#include <sys/un.h>

typedef struct sim_watch {
    void (*ready)(struct sim_watch *watch); ///< Called if data can be read or the other end has closed.
    void *owner;
    int fd;
} sim_watch_t;

typedef struct {
    int epoll_fd;
    int timer_fd;
} sim_loop_t;

/// Returns the time of CLOCK_MONOTONIC in microseconds.
iw_time_us_t sim_loop_clock_us(void);

/// Opens the loop. Returns false, with errno, if the system refuses.
bool sim_loop_open(sim_loop_t *self);

/// Adds a watch. `watch` must be filled in and must not move until it is removed. Returns false, with errno, if the
/// system refuses.
bool sim_loop_add(const sim_loop_t *self, sim_watch_t *watch);
void sim_loop_remove(const sim_loop_t *self, const sim_watch_t *watch);

/// Removes the watch, closes its descriptor and sets `fd` to -1.
void sim_loop_drop(const sim_loop_t *self, sim_watch_t *watch);

/// Waits for the next event or until `wake_us` (IW_NEVER: for events only). Then calls `before`, and after it the
/// handlers of the watches that are ready.
void sim_loop_wait(const sim_loop_t *self, iw_time_us_t wake_us, void (*before)(void *context), void *context);

// --- a unix socket that accepts clients, created and removed safely ----------------------------------------------

typedef struct {
    sim_watch_t watch; ///< `fd` is -1 unless open.
    const sim_loop_t *loop;
    /// Accepts a new non-blocking connection, or returns false; then it is closed.
    bool (*admit)(void *owner, int fd);
    void *owner;
    char path[sizeof(((struct sockaddr_un *)0)->sun_path)];
    dev_t device; ///< Device and inode of the created socket file: no other file is removed.
    ino_t inode;
} sim_listener_t;

typedef struct {
    char text[256];
} sim_reason_t;

/// Listens at `path` with sockets of `type` (SOCK_STREAM or SOCK_SEQPACKET), mode 0660. `loop`, `admit` and `owner`
/// must be set. An existing file is replaced only if it is a socket without a listener. Returns false, with cause and
/// fix in `*out_reason`, if that is not possible.
bool sim_listener_open(sim_listener_t *self, const char *path, int type, sim_reason_t *out_reason);

/// Closes the listener and removes its socket file.
void sim_listener_close(sim_listener_t *self);

/// Connects to the socket of another process; blocking. Returns the descriptor; -1 with errno on failure.
int sim_listener_connect(const char *path, int type);

#endif
