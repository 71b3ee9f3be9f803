// SPDX-License-Identifier: MIT
/// List of new connections that have not sent anything yet. A connection that sends nothing uses only a descriptor and
/// does not block other clients.
///
/// Each connection has WEB_BACKLOG_GRACE_US to send. After that time the oldest one is closed when the list is full.
/// Until then new connections wait in the queue of the kernel, so at least WEB_BACKLOG_MAX are accepted per grace time.
#ifndef WEB_BACKLOG_H
#define WEB_BACKLOG_H

#include <stdbool.h>
#include <stdint.h>

#define WEB_BACKLOG_LISTENERS 2U
#define WEB_BACKLOG_MAX       256U
#define WEB_BACKLOG_GRACE_US  50000U
/// A connection that sends nothing for this time is closed, even if the list is not full.
#define WEB_BACKLOG_US 5000000U

typedef struct {
    int fd;
    uint64_t since_us;
} web_pending_t;

typedef struct {
    int listen_fds[WEB_BACKLOG_LISTENERS]; ///< -1: none.
    int epoll_fd;                          ///< For poll(): a waiting connection has sent something or has closed.
    unsigned count;
    uint64_t crowded_out;                   ///< Connections that were closed for newer ones.
    web_pending_t pending[WEB_BACKLOG_MAX]; ///< Oldest first.
} web_backlog_t;

/// Owns these listening sockets from now on, which do not block (-1: none). Returns false with errno and closes them if
/// there is no epoll descriptor.
bool web_backlog_open(web_backlog_t *self, const int listen_fds[WEB_BACKLOG_LISTENERS]);

/// Closes the listening sockets and all connections of the list.
void web_backlog_close(web_backlog_t *self);

/// Accepts new connections while the list is not full, and closes those whose time is over.
void web_backlog_step(web_backlog_t *self, uint64_t now_us);

/// Removes a connection that has sent something or has closed, and passes its descriptor to the caller. Returns -1 if
/// there is none.
int web_backlog_take(web_backlog_t *self);

/// Returns the descriptor for poll() of this listening socket; -1 if the list is full.
int web_backlog_fd(const web_backlog_t *self, unsigned listener, uint64_t now_us);

/// Returns the time of the next work of `step` without input.
uint64_t web_backlog_next_us(const web_backlog_t *self, uint64_t now_us);

#endif
