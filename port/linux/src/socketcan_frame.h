// SPDX-License-Identifier: MIT
/// Frames as the kernel has them and as the core has them, and which of them to ask for. Pure functions.
#ifndef IW_SOCKETCAN_FRAME_H
#define IW_SOCKETCAN_FRAME_H

#include "iwheel/codec.h"
#include "iwheel_linux/bus_link.h"

#include <linux/can.h>

/// The eleven ids of the document.
#define IW_SOCKETCAN_IDS IW_CODEC_ROWS

/// Which share of the bus a socket is to see.
typedef enum {
    IW_SOCKETCAN_OURS,   ///< The eleven ids in every format: the number alone counts, remote or extended or not.
    IW_SOCKETCAN_OTHERS, ///< Everything else; to be joined: a frame must pass all filters.
} iw_socketcan_share_t;

/// Writes IW_SOCKETCAN_IDS filters.
void iw_socketcan_filters(iw_socketcan_share_t share, struct can_filter *out_filters);

/// `flags` are those of the received message: MSG_CONFIRM marks the echo of this very socket's frame, MSG_TRUNC (with
/// a buffer of one classic frame) an FD frame.
iw_can_frame_t iw_socketcan_translate(const struct can_frame *raw, int flags);

/// What an error frame says of the controller's state.
typedef enum {
    IW_CAN_ERROR_NOTHING = 0, ///< Nothing of it (a lost arbitration, an overflow).
    IW_CAN_ERROR_BUS_OFF,
    IW_CAN_ERROR_RESTARTED,
    IW_CAN_ERROR_PASSIVE,
    IW_CAN_ERROR_ACTIVE, ///< Error active, or warning level.
} iw_can_error_t;

/// The classes of error frames that `iw_can_error_of` understands, for CAN_RAW_ERR_FILTER.
uint32_t iw_can_error_mask(void);

/// `raw` must be an error frame. If it reports several states, the gravest.
iw_can_error_t iw_can_error_of(const struct can_frame *raw);

/// Bits that the frame occupies on the bus, with the gap behind it, without stuff bits.
static inline uint32_t iw_socketcan_bits(const struct can_frame *raw) {
    const iw_can_frame_t frame = {.id = raw->can_id, .dlc = raw->len};
    return iw_bus_frame_bits(&frame);
}

#endif
