// SPDX-License-Identifier: MIT
/// One socket that carries `struct can_frame`, and the frames taken from it in batches: a CAN_RAW socket, or a
/// connection to the simulator's hub, which marks in `__res0` what the kernel tells by flags.
#ifndef IW_SOCKETCAN_SOCKET_H
#define IW_SOCKETCAN_SOCKET_H

#include "socketcan_frame.h"

#include <sys/socket.h>

/// Frames taken from the kernel in one call.
#define IW_SOCKETCAN_BATCH       32U
#define IW_SOCKETCAN_DROPS_SPACE CMSG_SPACE(sizeof(uint32_t))

typedef struct {
    struct can_frame frame[IW_SOCKETCAN_BATCH];
    int flags[IW_SOCKETCAN_BATCH]; ///< Of the message: MSG_CONFIRM, MSG_DONTROUTE, MSG_TRUNC.
    uint32_t count;
    uint32_t next;
    uint32_t lost; ///< Frames that the kernel dropped for want of room, since the socket was opened.
    struct mmsghdr message[IW_SOCKETCAN_BATCH]; ///< Where the kernel puts frames: made once.
    struct iovec part[IW_SOCKETCAN_BATCH];
    _Alignas(struct cmsghdr) uint8_t drops[IW_SOCKETCAN_DROPS_SPACE]; ///< What it says beside the last frame.
    int fd;                                                           ///< -1: closed.
    bool drained; ///< The last batch was short: there was nothing more.
    bool is_hub;  ///< It is a connection to the hub.
} iw_socketcan_socket_t;

/// Closed, and empty. Not the same as `close`: whatever `fd` was is forgotten.
void iw_socketcan_socket_init(iw_socketcan_socket_t *self);

/// Begins to take frames from `fd`; the hub's is not closed here. `self` must not move any more.
void iw_socketcan_socket_use(iw_socketcan_socket_t *self, int fd, bool is_hub);

/// Opens it, not blocking, on the interface with this index. IW_SOCKETCAN_OURS: with error frames, FD frames and own
/// echoes. 0, or an errno.
int iw_socketcan_socket_open(iw_socketcan_socket_t *self, int interface, iw_socketcan_share_t share);
void iw_socketcan_socket_close(iw_socketcan_socket_t *self);

/// True if all that was taken has been used.
static inline bool iw_socketcan_socket_is_empty(const iw_socketcan_socket_t *self) {
    return self->next == self->count;
}

/// What was taken and not used is forgotten.
void iw_socketcan_socket_forget(iw_socketcan_socket_t *self);

/// Takes and forgets everything that waits in the kernel, errors too. 0, or the errno met last.
int iw_socketcan_socket_drop(iw_socketcan_socket_t *self);

/// Takes the next batch; only when empty. 0 (there may be none), or the errno that tells why the bus is lost.
int iw_socketcan_socket_fill(iw_socketcan_socket_t *self);

/// > 0: handed over. 0: no room now. < 0: the bus is lost.
int iw_socketcan_socket_send(const iw_socketcan_socket_t *self, const iw_can_frame_t *frame);

#endif
