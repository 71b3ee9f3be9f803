// SPDX-License-Identifier: MIT
/// @file
/// A classic CAN frame as a value.
///
/// The id word carries the frame's format in its upper bits, so that one comparison with an 11-bit number refuses
/// every remote, extended, error and FD frame that happens to bear the same number.
#ifndef IW_CAN_FRAME_H
#define IW_CAN_FRAME_H

#include <stdint.h>

#define IW_CAN_EXTENDED 0x80000000U ///< 29-bit id.
#define IW_CAN_REMOTE   0x40000000U ///< Remote transmission request: carries no data.
#define IW_CAN_ERROR    0x20000000U ///< Not a frame of the bus but the controller's report of an error.
#define IW_CAN_FD       0x10000000U ///< CAN FD frame with an 11-bit id; `data` holds its first 8 bytes.
#define IW_CAN_ID_MASK  0x000007FFU ///< An 11-bit id. All other bits of a usable frame's id word are zero.
#define IW_CAN_DATA_MAX 8U          ///< Bytes of a classic frame.

/// Where a frame came from.
typedef enum {
    IW_CAN_RECEIVED = 0, ///< Another node sent it.
    IW_CAN_ECHO = 1,     ///< We sent it and the controller says that it is on the bus.
} iw_can_kind_t;

/// A frame of the bus, or one for it.
typedef struct {
    uint32_t id;                   ///< 11-bit id, or'ed with IW_CAN_EXTENDED, IW_CAN_REMOTE, IW_CAN_ERROR, IW_CAN_FD.
    uint8_t data[IW_CAN_DATA_MAX]; ///< At a multiple of four bytes: read and written a word at a time.
    uint8_t dlc;                   ///< Number of bytes in `data`, 0..8.
    uint8_t kind;                  ///< An iw_can_kind_t. Ignored when sending.
} iw_can_frame_t;

#endif
