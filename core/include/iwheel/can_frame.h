// SPDX-License-Identifier: MIT
/// @file
/// A classic CAN frame.
///
/// The upper bits of the id word are the format of the frame. One comparison with an 11-bit id therefore refuses every
/// remote, extended, error and FD frame with the same number.
#ifndef IW_CAN_FRAME_H
#define IW_CAN_FRAME_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define IW_CAN_EXTENDED 0x80000000U ///< 29-bit id.
#define IW_CAN_REMOTE   0x40000000U ///< Remote transmission request: carries no data.
#define IW_CAN_ERROR    0x20000000U ///< Not a frame of the bus but the controller's report of an error.
#define IW_CAN_FD       0x10000000U ///< CAN FD frame with an 11-bit id; `data` holds its first 8 bytes.
#define IW_CAN_ID_MASK  0x000007FFU ///< An 11-bit id. All other bits of a usable frame's id word are zero.
#define IW_CAN_DATA_MAX 8U          ///< Bytes of a classic frame.

/// Source of a frame.
typedef enum {
    IW_CAN_RECEIVED = 0, ///< Another node sent it.
    IW_CAN_ECHO = 1,     ///< This node sent it, and the controller confirms that it was on the bus.
} iw_can_kind_t;

/// A frame that was received or is to be sent.
typedef struct {
    uint32_t id;                   ///< 11-bit id, or'ed with IW_CAN_EXTENDED, IW_CAN_REMOTE, IW_CAN_ERROR, IW_CAN_FD.
    uint8_t data[IW_CAN_DATA_MAX]; ///< Data, aligned to four bytes: the codec reads and writes words.
    uint8_t dlc;                   ///< Number of bytes in `data`, 0..8.
    uint8_t kind;                  ///< An iw_can_kind_t. Ignored when sending.
} iw_can_frame_t;

#ifdef __cplusplus
}
#endif
#endif
