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

/// What an id word has beyond a number of 11 bits: the format.
#define IW_PROTO_FORMAT_BITS (IW_CAN_EXTENDED | IW_CAN_REMOTE | IW_CAN_ERROR | IW_CAN_FD)

/// Where the values of a status lie.
#define IW_PROTO_AT_BATTERY     0
#define IW_PROTO_AT_TEMPERATURE 1
#define IW_PROTO_AT_ODOMETRY    2
#define IW_PROTO_AT_CPU         6

/// Puts what comes most often where no jump is needed: one instruction of 20 on x86-64.
#ifdef __GNUC__
#define IW_PROTO_LIKELY(condition) (__builtin_expect((condition) ? 1 : 0, 1) == 1)
#else
#define IW_PROTO_LIKELY(condition) (condition)
#endif

/// `least`..8 bytes: one comparison for both ends.
static inline bool iw_proto_fits(uint32_t length, uint32_t least) {
    return length - least <= IW_CAN_DATA_MAX - least;
}

/// The first of the two lies second in memory, so that both are one load, swap and store.
static inline void iw_proto_read_speed(const iw_can_frame_t *frame, iw_proto_speed_t *out_speed) {
    const uint32_t both = iw_be_get_u32(&frame->data[0]);
    out_speed->acceleration_raw = iw_be_low_i16(both);
    out_speed->speed_rpm = iw_be_low_i16(both >> 16);
}

/// As `iw_proto_read_speed`.
static inline void iw_proto_read_force(const iw_can_frame_t *frame, iw_proto_force_t *out_force) {
    const uint32_t both = iw_be_get_u32(&frame->data[0]);
    out_force->debug_raw = iw_be_low_i16(both);
    out_force->force_raw = iw_be_low_i16(both >> 16);
}

static inline void iw_proto_read_status(const iw_can_frame_t *frame, iw_proto_status_t *out_status) {
    out_status->battery_dV = frame->data[IW_PROTO_AT_BATTERY];
    out_status->temperature_degC = frame->data[IW_PROTO_AT_TEMPERATURE];
    out_status->odometry_ticks = iw_be_get_i32(&frame->data[IW_PROTO_AT_ODOMETRY]);
    out_status->cpu_percent = frame->data[IW_PROTO_AT_CPU];
}

static inline void iw_proto_read_pose(const iw_can_frame_t *frame, iw_proto_pose_t *out_pose) {
    out_pose->x_mm = iw_be_get_i16(&frame->data[0]);
    out_pose->y_mm = iw_be_get_i16(&frame->data[2]);
    out_pose->z_mm = iw_be_get_i16(&frame->data[4]);
    out_pose->psi_mrad = iw_be_get_i16(&frame->data[6]);
}

static inline void iw_proto_read_setpoint(const iw_can_frame_t *frame, iw_proto_setpoint_t *out_setpoint) {
    out_setpoint->type = frame->data[0];
    out_setpoint->speed_mm_s = iw_be_get_i16(&frame->data[1]);
    out_setpoint->current_mA = iw_be_get_i16(&frame->data[3]);
}

/// Why a frame with the number of a message is none.
static inline iw_status_t iw_proto_refusal(uint32_t format) {
    return (format != 0U) ? IW_ERR_FORMAT : IW_ERR_LENGTH;
}

/// `iw_proto_decode` of whatever is not a speed.
static inline iw_status_t iw_proto_read_other(const iw_can_frame_t *frame, iw_proto_message_t *out_message) {
    const uint32_t format = frame->id & IW_PROTO_FORMAT_BITS;
    const uint32_t number = frame->id & ~(IW_PROTO_FORMAT_BITS | IW_PROTO_SIDE_BIT);
    const uint32_t length = frame->dlc | format; // No length fits where the format does not: one comparison for both.
    switch (number) {
    case IW_ID_LEFT_STATUS:
        if (!iw_proto_fits(length, IW_DLC_STATUS)) {
            return iw_proto_refusal(format);
        }
        out_message->kind = IW_PROTO_STATUS;
        iw_proto_read_status(frame, &out_message->as.status);
        break;
    case IW_ID_LEFT_FORCE:
        if (!iw_proto_fits(length, IW_DLC_FORCE)) {
            return iw_proto_refusal(format);
        }
        out_message->kind = IW_PROTO_FORCE;
        iw_proto_read_force(frame, &out_message->as.force);
        break;
    case IW_ID_NO_POSE:
        if ((frame->id & IW_PROTO_SIDE_BIT) == 0U) {
            return IW_ERR_ID;
        }
        if (!iw_proto_fits(length, IW_DLC_POSE)) {
            return iw_proto_refusal(format);
        }
        out_message->kind = IW_PROTO_POSE;
        iw_proto_read_pose(frame, &out_message->as.pose);
        break;
    case IW_ID_LEFT_OFFSET:
        if (!iw_proto_fits(length, IW_DLC_OFFSET)) {
            return iw_proto_refusal(format);
        }
        out_message->kind = IW_PROTO_OFFSET;
        out_message->as.offset.offset_dN = iw_be_get_i16(&frame->data[0]);
        break;
    case IW_ID_LEFT_SETPOINT:
        if (!iw_proto_fits(length, IW_DLC_SETPOINT)) {
            return iw_proto_refusal(format);
        }
        out_message->kind = IW_PROTO_SETPOINT;
        iw_proto_read_setpoint(frame, &out_message->as.setpoint);
        break;
    default:
        return (number == IW_ID_LEFT_SPEED) ? iw_proto_refusal(format) : IW_ERR_ID;
    }
    out_message->side = (iw_side_t)((frame->id >> IW_PROTO_SIDE_SHIFT) & 1U);
    return IW_OK;
}

/// The same, once in a program.
iw_status_t iw_proto_decode_other(const iw_can_frame_t *frame, iw_proto_message_t *out_message);

/// Reads any of the eleven messages. Bytes behind the table's length are ignored (a longer frame is accepted).
/// IW_ERR_FORMAT: one of the eleven numbers on a remote, extended, error or FD frame. IW_ERR_ID: any other number,
/// whatever its format. IW_ERR_LENGTH: shorter than the table or dlc > 8. A refused frame leaves the message as it was.
///
/// Four frames of five are speeds: they are always read in line; all others too where the program is built for speed.
static inline iw_status_t iw_proto_decode(const iw_can_frame_t *frame, iw_proto_message_t *out_message) {
    const uint32_t from_speed = frame->id - IW_ID_LEFT_SPEED;
    if (IW_PROTO_LIKELY((from_speed & ~IW_PROTO_SIDE_BIT) == 0U && iw_proto_fits(frame->dlc, IW_DLC_SPEED))) {
        out_message->kind = IW_PROTO_SPEED;
        out_message->side = (iw_side_t)(from_speed >> IW_PROTO_SIDE_SHIFT);
        iw_proto_read_speed(frame, &out_message->as.speed);
        return IW_OK;
    }
#ifndef __OPTIMIZE_SIZE__
    if (iw_proto_read_other(frame, out_message) == IW_OK) {
        return IW_OK;
    }
#endif
    return iw_proto_decode_other(frame, out_message); // Why it is refused need not be in line as well.
}

#endif
