// SPDX-License-Identifier: MIT
/// Reading frames. In line, because it runs for every frame on the bus; `iwheel/proto.h` includes it.
#ifndef IW_PROTO_DECODE_H
#define IW_PROTO_DECODE_H

#include "iwheel/be.h"
#include "iwheel/proto_types.h"

/// The ids of the right wheel's messages are those of the left one's plus this: one bit.
#define IW_PROTO_SIDE_SHIFT 5U
#define IW_PROTO_SIDE_BIT   (1U << IW_PROTO_SIDE_SHIFT)
/// What would be a pose of the left wheel: there is none.
#define IW_ID_NO_POSE (IW_ID_RIGHT_POSE - IW_PROTO_SIDE_BIT)

/// Reads a setpoint of `dlc` 5 or more.
static inline void iw_proto_get_setpoint(const iw_can_frame_t *frame, iw_proto_setpoint_t *out_setpoint) {
    out_setpoint->type = frame->data[0];
    out_setpoint->speed_mm_s = iw_be_get_i16(&frame->data[1]);
    out_setpoint->current_mA = iw_be_get_i16(&frame->data[3]);
}

/// `iw_proto_decode` of whatever is not a speed.
iw_status_t iw_proto_decode_other(const iw_can_frame_t *frame, iw_proto_message_t *out_message);

/// Reads any of the eleven messages. Bytes behind the table's length are ignored (a longer frame is accepted).
/// IW_ERR_FORMAT: one of the eleven numbers on a remote, extended, error or FD frame. IW_ERR_ID: any other number,
/// whatever its format. IW_ERR_LENGTH: shorter than the table or dlc > 8.
///
/// Four frames of five are speeds: they are read in line, both halves of their word at once. (The second one lies first
/// in memory, so that it is one load, swap and store.)
static inline iw_status_t iw_proto_decode(const iw_can_frame_t *frame, iw_proto_message_t *out_message) {
    const uint32_t from_speed = frame->id - IW_ID_LEFT_SPEED;
    if ((from_speed & ~IW_PROTO_SIDE_BIT) != 0U || frame->dlc < IW_DLC_SPEED || frame->dlc > IW_CAN_DATA_MAX) {
        return iw_proto_decode_other(frame, out_message);
    }
    const uint32_t both = iw_be_get_u32(&frame->data[0]);
    out_message->kind = IW_PROTO_SPEED;
    out_message->side = (iw_side_t)(from_speed >> IW_PROTO_SIDE_SHIFT);
    out_message->as.speed.acceleration_raw = iw_be_low_i16(both);
    out_message->as.speed.speed_rpm = iw_be_low_i16(both >> 16);
    return IW_OK;
}

#endif
