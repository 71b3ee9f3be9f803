// SPDX-License-Identifier: MIT
/// Conversion between frames of the kernel and frames of the core, filters (pure functions), and a socket.
///
/// The socket carries `struct can_frame`, and frames are received in batches. It is a CAN_RAW socket, or a connection
/// to the simulator's hub, which sets marks in `__res0` instead of the kernel's flags.
#ifndef IWL_SOCKETCAN_SOCKET_H
#define IWL_SOCKETCAN_SOCKET_H

#include "iwheel/codec.h"
#include "iwheel_linux/bus_link.h"

#include <linux/can.h>
#include <sys/socket.h>

/// The eleven ids of the document.
#define IWL_SOCKETCAN_IDS IW_CODEC_ROWS

/// Part of the bus traffic that a socket receives.
typedef enum {
    IWL_SOCKETCAN_OURS,   ///< The eleven ids in every format: only the number counts.
    IWL_SOCKETCAN_OTHERS, ///< All other frames. The filters must be joined: a frame must pass all of them.
} iwl_socketcan_share_t;

/// Writes IWL_SOCKETCAN_IDS filters.
void iwl_socketcan_filters(iwl_socketcan_share_t share, struct can_filter *out_filters);

/// Converts a frame of the kernel. `flags` are those of the received message: MSG_CONFIRM marks the echo of a frame of
/// this socket, MSG_TRUNC (with a buffer of one classic frame) an FD frame.
iw_can_frame_t iwl_socketcan_translate(const struct can_frame *raw, int flags);

/// Report of an error frame about the state of the controller.
typedef enum {
    IWL_CAN_ERROR_NOTHING = 0, ///< No state (for example a lost arbitration or an overflow).
    IWL_CAN_ERROR_BUS_OFF,
    IWL_CAN_ERROR_RESTARTED,
    IWL_CAN_ERROR_PASSIVE,
    IWL_CAN_ERROR_ACTIVE, ///< Error active, or warning level.
} iwl_can_error_t;

/// Returns the classes of error frames that `iwl_can_error_of` understands, for CAN_RAW_ERR_FILTER.
uint32_t iwl_can_error_mask(void);

/// Classifies an error frame. If it reports several states, returns the most severe one.
iwl_can_error_t iwl_can_error_of(const struct can_frame *raw);

/// Returns the number of bits of the frame on the bus, with the gap after it, without stuff bits.
static inline uint32_t iwl_socketcan_bits(const struct can_frame *raw) {
    const iw_can_frame_t frame = {.id = raw->can_id, .dlc = raw->len};
    return iwl_bus_frame_bits(&frame);
}

/// Number of frames received in one system call.
#define IWL_SOCKETCAN_BATCH       32U
#define IWL_SOCKETCAN_DROPS_SPACE CMSG_SPACE(sizeof(uint32_t))

typedef struct {
    struct can_frame frame[IWL_SOCKETCAN_BATCH];
    int flags[IWL_SOCKETCAN_BATCH]; ///< Flags of each message: MSG_CONFIRM, MSG_DONTROUTE, MSG_TRUNC.
    uint32_t count;
    uint32_t next;
    uint32_t
        lost; ///< Number of frames that the kernel dropped because its buffer was full, since the socket was opened.
    struct mmsghdr message[IWL_SOCKETCAN_BATCH]; ///< Buffers of the messages, set up once.
    struct iovec part[IWL_SOCKETCAN_BATCH];
    _Alignas(struct cmsghdr) uint8_t drops[IWL_SOCKETCAN_DROPS_SPACE]; ///< Control data of the last message.
    int fd;                                                            ///< Descriptor; -1 if closed.
    bool drained; ///< The last batch was not full: the kernel has no more frames.
    bool is_hub;  ///< The socket is a connection to the hub.
} iwl_socketcan_socket_t;

/// Initializes `self` as closed and empty. It does not close a descriptor.
void iwl_socketcan_socket_init(iwl_socketcan_socket_t *self);

/// Begins to receive from `fd`. The owner of a hub's descriptor closes it. `self` must not move from now on.
void iwl_socketcan_socket_use(iwl_socketcan_socket_t *self, int fd, bool is_hub);

/// Opens the socket, non-blocking, on the interface with this index. IWL_SOCKETCAN_OURS: with error frames, FD frames
/// and own echoes. Returns 0 or an errno.
int iwl_socketcan_socket_open(iwl_socketcan_socket_t *self, int interface, iwl_socketcan_share_t share);

/// Returns `room_bytes` of the link: the granted part of IWL_LINK_ROOM_BYTES as the kernel counts it; 0 if unknown.
uint32_t iwl_socketcan_socket_room(const iwl_socketcan_socket_t *self);
void iwl_socketcan_socket_close(iwl_socketcan_socket_t *self);

/// Returns true if all frames of the batch are used.
static inline bool iwl_socketcan_socket_is_empty(const iwl_socketcan_socket_t *self) {
    return self->next == self->count;
}

/// Drops the unused frames of the batch.
void iwl_socketcan_socket_forget(iwl_socketcan_socket_t *self);

/// Drops all frames and errors that wait in the kernel. Returns 0 or the last errno.
int iwl_socketcan_socket_drop(iwl_socketcan_socket_t *self);

/// Receives the next batch. Call it only when empty. Returns 0 (there may be no frame) or the errno of the lost bus.
int iwl_socketcan_socket_fill(iwl_socketcan_socket_t *self);

/// Implements `send` of iw_hal_t: all frames in one system call. No signal ends that call between two frames, not even
/// SIGKILL. The kernel may run another process between them, its queue may have space for one frame only, and it drops
/// the error of the second frame, which the next call reports.
int iwl_socketcan_socket_send(const iwl_socketcan_socket_t *self, const iw_can_frame_t *frames, uint32_t count);

#endif
