// SPDX-License-Identifier: MIT
/// Where who has connected waits until he says something: so those that say nothing cost a descriptor, and keep nobody out.
///
/// Everybody has WEB_DOOR_GRACE_US to speak. After that the oldest makes room when the room is full; until then newcomers wait in the
/// kernel's queue, and come in at WEB_DOOR_MAX per grace or faster.
#ifndef WEB_DOOR_H
#define WEB_DOOR_H

#include <stdbool.h>
#include <stdint.h>

#define WEB_DOOR_LISTENERS 2U
#define WEB_DOOR_MAX       256U
#define WEB_DOOR_GRACE_US  50000U
/// Who says nothing is not kept longer, even if there is room.
#define WEB_DOOR_US 5000000U

typedef struct {
    int fd;
    uint64_t since_us;
} web_guest_t;

typedef struct {
    int listen_fds[WEB_DOOR_LISTENERS]; ///< -1: there is none.
    int epoll_fd;                       ///< For poll(): a waiting connection has sent something, or left.
    unsigned count;
    uint64_t crowded_out;             ///< Who made room for others.
    web_guest_t guests[WEB_DOOR_MAX]; ///< The oldest first.
} web_door_t;

/// Owns listening sockets that do not block (-1: none). False, with errno: no room can be made; they are closed.
bool web_door_open(web_door_t *self, const int listen_fds[WEB_DOOR_LISTENERS]);
void web_door_close(web_door_t *self);

/// Lets in who can be let in, and shows out who must go.
void web_door_step(web_door_t *self, uint64_t now_us);

/// Somebody who has spoken, and is no guest any more: a descriptor for the caller. -1: nobody.
int web_door_take(web_door_t *self);

/// For poll(): there is a newcomer on this listening socket; -1: the room is full.
int web_door_fd(const web_door_t *self, unsigned listener, uint64_t now_us);

/// When `step` has something to do, whatever comes.
uint64_t web_door_next_us(const web_door_t *self, uint64_t now_us);

#endif
