// SPDX-License-Identifier: MIT
/// Child process for work that may wait for a disk, so that the loop never does. One child writes recordings, one reads
/// them, and one stores assumptions. This file starts a child, exchanges messages with it, and handles its end.
///
///     NONE --start--> RUNNING --end detected--> NONE --needed again, 10 s after its start--> RUNNING
///
///     gateway <--messages, whole or not at all, through a socket that never blocks--> child
///
/// There are three processes because a recording needs two seconds and megabytes, reading lasts as long as a client
/// reads, and assumptions must be on the disk within a second. If one is killed, the others are not affected.
///
/// A child inherits nothing of the gateway but its end of the socket: no stream, no folder, no descriptor. It ignores
/// the signals that end the gateway. It ends after the gateway has ended and the last message is processed.
#ifndef GATEWAY_CHILD_H
#define GATEWAY_CHILD_H

#include "iwheel/types.h"

#include <sys/types.h>

/// Description of a child, the same for each of its processes.
typedef struct {
    const char *name;                         ///< Name in the output of ps, 15 characters at most.
    int nice;                                 ///< 0..19: the loop has precedence.
    void (*run)(int fd, const void *context); ///< Runs until the socket `fd` reports that the gateway has ended.
    const void *context;                      ///< It must exist as long as the child.
} gw_child_work_t;

typedef struct {
    gw_child_work_t work;
    int fd; ///< Socket to the child; -1 if there is none.
    pid_t pid;
    iw_time_us_t started_us;
} gw_child_t;

typedef enum {
    GW_CHILD_SILENT = 0,
    GW_CHILD_MESSAGE,
    GW_CHILD_ENDED, ///< The child has ended; earlier messages have no reply. Reported once.
} gw_child_news_t;

/// Starts the child. Returns 0 or an errno; then there is none. Call it while nothing is sent.
int gw_child_start(gw_child_t *self, const gw_child_work_t *work);

/// Starts the child again if it has ended, unless its last start was recent. Returns false if there is none.
bool gw_child_revive(gw_child_t *self);

/// Sends a message. Returns false and sets errno if it cannot: the child has ended, or has too many messages (EAGAIN).
bool gw_child_send(const gw_child_t *self, const void *message, size_t length);

/// Receives the next message. GW_CHILD_MESSAGE: `*out_length` is its length. Never waits. A message longer than `size` is
/// truncated.
gw_child_news_t gw_child_receive(gw_child_t *self, void *out_message, size_t size, size_t *out_length);

/// Lets the child finish and end. Also for a child with an invalid message.
void gw_child_close(gw_child_t *self);

#endif
