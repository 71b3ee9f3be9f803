// SPDX-License-Identifier: MIT
/// List of new connections that have not sent anything yet. A connection that sends nothing uses only a descriptor and
/// does not block other clients.
///
/// Each connection has WEB_DOOR_GRACE_US to send. After that time the oldest one is closed when the list is full. Until
/// then new connections wait in the queue of the kernel, so at least WEB_DOOR_MAX are accepted per grace time.
#ifndef WEB_DOOR_H
#define WEB_DOOR_H

#include <stdbool.h>
#include <stdint.h>

#define WEB_DOOR_LISTENERS 2U
#define WEB_DOOR_MAX       256U
#define WEB_DOOR_GRACE_US  50000U
/// A connection that sends nothing for this time is closed, even if the list is not full.
#define WEB_DOOR_US 5000000U

typedef struct {
    int fd;
    uint64_t since_us;
} web_guest_t;

typedef struct {
    int listen_fds[WEB_DOOR_LISTENERS]; ///< -1: none.
    int epoll_fd;                       ///< For poll(): a waiting connection has sent something or has closed.
    unsigned count;
    uint64_t crowded_out;             ///< Connections that were closed for newer ones.
    web_guest_t guests[WEB_DOOR_MAX]; ///< Oldest first.
} web_door_t;

/// Owns these listening sockets from now on, which do not block (-1: none). Returns false with errno and closes them if
/// there is no epoll descriptor.
bool web_door_open(web_door_t *self, const int listen_fds[WEB_DOOR_LISTENERS]);

/// Closes the listening sockets and all connections of the list.
void web_door_close(web_door_t *self);

/// Accepts new connections while the list is not full, and closes those whose time is over.
void web_door_step(web_door_t *self, uint64_t now_us);

/// Removes a connection that has sent something or has closed, and passes its descriptor to the caller. Returns -1 if
/// there is none.
int web_door_take(web_door_t *self);

/// Returns the descriptor for poll() of this listening socket; -1 if the list is full.
int web_door_fd(const web_door_t *self, unsigned listener, uint64_t now_us);

/// Returns the time of the next work of `step` without input.
uint64_t web_door_next_us(const web_door_t *self, uint64_t now_us);

#endif
