// SPDX-License-Identifier: MIT
/// Frames as the kernel has them and as the core has them, and which of them to ask for: pure functions.
///
/// One socket that carries `struct can_frame`, and the frames taken from it in batches: a CAN_RAW socket, or a
/// connection to the simulator's hub, which marks in `__res0` what the kernel tells by flags.
#ifndef IWL_SOCKETCAN_SOCKET_H
#define IWL_SOCKETCAN_SOCKET_H

#include "iwheel/codec.h"
#include "iwheel_linux/bus_link.h"

#include <linux/can.h>
#include <sys/socket.h>

/// The eleven ids of the document.
#define IWL_SOCKETCAN_IDS IW_CODEC_ROWS

/// Which share of the bus a socket is to see.
typedef enum {
    IWL_SOCKETCAN_OURS,   ///< The eleven ids in every format: the number alone counts, remote or extended or not.
    IWL_SOCKETCAN_OTHERS, ///< Everything else; to be joined: a frame must pass all filters.
} iwl_socketcan_share_t;

/// Writes IWL_SOCKETCAN_IDS filters.
void iwl_socketcan_filters(iwl_socketcan_share_t share, struct can_filter *out_filters);

/// `flags` are those of the received message: MSG_CONFIRM marks the echo of this very socket's frame, MSG_TRUNC (with
/// a buffer of one classic frame) an FD frame.
iw_can_frame_t iwl_socketcan_translate(const struct can_frame *raw, int flags);

/// What an error frame says of the controller's state.
typedef enum {
    IWL_CAN_ERROR_NOTHING = 0, ///< Nothing of it (a lost arbitration, an overflow).
    IWL_CAN_ERROR_BUS_OFF,
    IWL_CAN_ERROR_RESTARTED,
    IWL_CAN_ERROR_PASSIVE,
    IWL_CAN_ERROR_ACTIVE, ///< Error active, or warning level.
} iwl_can_error_t;

/// The classes of error frames that `iwl_can_error_of` understands, for CAN_RAW_ERR_FILTER.
uint32_t iwl_can_error_mask(void);

/// `raw` must be an error frame. If it reports several states, the gravest.
iwl_can_error_t iwl_can_error_of(const struct can_frame *raw);

/// Bits that the frame occupies on the bus, with the gap behind it, without stuff bits.
static inline uint32_t iwl_socketcan_bits(const struct can_frame *raw) {
    const iw_can_frame_t frame = {.id = raw->can_id, .dlc = raw->len};
    return iwl_bus_frame_bits(&frame);
}

/// Frames taken from the kernel in one call.
#define IWL_SOCKETCAN_BATCH       32U
#define IWL_SOCKETCAN_DROPS_SPACE CMSG_SPACE(sizeof(uint32_t))

typedef struct {
    struct can_frame frame[IWL_SOCKETCAN_BATCH];
    int flags[IWL_SOCKETCAN_BATCH]; ///< Of the message: MSG_CONFIRM, MSG_DONTROUTE, MSG_TRUNC.
    uint32_t count;
    uint32_t next;
    uint32_t lost; ///< Frames that the kernel dropped for want of room, since the socket was opened.
    struct mmsghdr message[IWL_SOCKETCAN_BATCH]; ///< Where the kernel puts frames: made once.
    struct iovec part[IWL_SOCKETCAN_BATCH];
    _Alignas(struct cmsghdr) uint8_t drops[IWL_SOCKETCAN_DROPS_SPACE]; ///< What it says beside the last frame.
    int fd;                                                            ///< -1: closed.
    bool drained; ///< The last batch was short: there was nothing more.
    bool is_hub;  ///< It is a connection to the hub.
} iwl_socketcan_socket_t;

/// Closed, and empty. Not the same as `close`: whatever `fd` was is forgotten.
void iwl_socketcan_socket_init(iwl_socketcan_socket_t *self);

/// Begins to take frames from `fd`; the hub's is not closed here. `self` must not move any more.
void iwl_socketcan_socket_use(iwl_socketcan_socket_t *self, int fd, bool is_hub);

/// Opens it, not blocking, on the interface with this index. IWL_SOCKETCAN_OURS: with error frames, FD frames and own
/// echoes. 0, or an errno.
int iwl_socketcan_socket_open(iwl_socketcan_socket_t *self, int interface, iwl_socketcan_share_t share);

/// `room_bytes` of the link: what the kernel has granted of IWL_LINK_ROOM_BYTES, counted twice. 0: unknown.
uint32_t iwl_socketcan_socket_room(const iwl_socketcan_socket_t *self);
void iwl_socketcan_socket_close(iwl_socketcan_socket_t *self);

/// True if all that was taken has been used.
static inline bool iwl_socketcan_socket_is_empty(const iwl_socketcan_socket_t *self) {
    return self->next == self->count;
}

/// What was taken and not used is forgotten.
void iwl_socketcan_socket_forget(iwl_socketcan_socket_t *self);

/// Takes and forgets everything that waits in the kernel, errors too. 0, or the errno met last.
int iwl_socketcan_socket_drop(iwl_socketcan_socket_t *self);

/// Takes the next batch; only when empty. 0 (there may be none), or the errno that tells why the bus is lost.
int iwl_socketcan_socket_fill(iwl_socketcan_socket_t *self);

/// As `send` of iw_hal_t: all frames in one call of the kernel. That call does not end between two frames for a signal,
/// not even SIGKILL; but the kernel may let another process run there, its queue may have room for one frame only, and
/// it drops the error of the second frame: the next call reports it.
int iwl_socketcan_socket_send(const iwl_socketcan_socket_t *self, const iw_can_frame_t *frames, uint32_t count);

#endif
