// SPDX-License-Identifier: MIT
/// A process of ours that does what may wait for a disk, so that the loop never does: recordings are written by one, read by
/// another, what is learnt is kept by a third. This is how each of them is started, spoken with and lost.
///
///     NONE --start--> RUNNING --it ends: heard of--> NONE --asked for again, 10 s after its start--> RUNNING
///
///     gateway <--messages, whole or not at all, through a socket that never blocks--> child
///
/// Three and not one: a recording takes two seconds and megabytes, reading one as long as somebody reads, what is learnt
/// must be on the disk within a second, and whichever of them is killed takes nothing from the others.
///
/// A child holds nothing of the gateway's but its end of the socket: no stream, no folder, no descriptor. It ignores the
/// signals that end the gateway, and ends when the gateway is gone, after what it was given last.
#ifndef GATEWAY_CHILD_H
#define GATEWAY_CHILD_H

#include "iwheel/types.h"

#include <sys/types.h>

/// What it is and does; the same for all its lives.
typedef struct {
    const char *name;                         ///< As ps tells it, 15 characters at the most.
    int nice;                                 ///< 0..19: the motors come before it.
    void (*run)(int fd, const void *context); ///< Until the socket `fd` tells that the gateway is gone.
    const void *context;                      ///< Must outlive the child.
} gw_child_work_t;

typedef struct {
    gw_child_work_t work;
    int fd; ///< To it; -1: there is none.
    pid_t pid;
    iw_time_us_t started_us;
} gw_child_t;

typedef enum {
    GW_CHILD_SILENT = 0,
    GW_CHILD_SAID,
    GW_CHILD_ENDED, ///< What was asked before stays without an answer. Told once.
} gw_child_news_t;

/// 0, or an errno; there is none then. Call it while nothing is sent.
int gw_child_start(gw_child_t *self, const gw_child_work_t *work);

/// Starts it again if it has ended, unless it was started only just now. False: there is none.
bool gw_child_revive(gw_child_t *self);

/// False, with errno, if it cannot take the message: it is gone, or too far behind (EAGAIN).
bool gw_child_say(const gw_child_t *self, const void *message, size_t length);

/// Takes its next message; `*out_length` is written with GW_CHILD_SAID. Never waits. A message longer than `size` is cut off.
gw_child_news_t gw_child_receive(gw_child_t *self, void *out_message, size_t size, size_t *out_length);

/// Lets it finish and end by itself. Also for one that has said what nobody understands.
void gw_child_close(gw_child_t *self);

#endif
