// SPDX-License-Identifier: MIT
#include "iwheel/proto.h"

#include "iwheel/be.h"

#include <string.h>

#define FORMAT_BITS (IW_CAN_EXTENDED | IW_CAN_REMOTE | IW_CAN_ERROR | IW_CAN_FD)
#define BATTERY     0
#define TEMPERATURE 1
#define ODOMETRY    2
#define CPU         6

IW_STATIC_ASSERT(IW_ID_RIGHT_SETPOINT == (IW_ID_LEFT_SETPOINT | IW_PROTO_SIDE_BIT), setpoint_side);
IW_STATIC_ASSERT(IW_ID_RIGHT_SPEED == (IW_ID_LEFT_SPEED | IW_PROTO_SIDE_BIT), speed_side);
IW_STATIC_ASSERT(IW_ID_RIGHT_STATUS == (IW_ID_LEFT_STATUS | IW_PROTO_SIDE_BIT), status_side);
IW_STATIC_ASSERT(IW_ID_RIGHT_FORCE == (IW_ID_LEFT_FORCE | IW_PROTO_SIDE_BIT), force_side);
IW_STATIC_ASSERT(IW_ID_RIGHT_OFFSET == (IW_ID_LEFT_OFFSET | IW_PROTO_SIDE_BIT), offset_side);

/// Indexed by iw_proto_kind_t: the left wheel's ids, and how long each message is at least.
static const uint16_t left_ids[] = {IW_ID_LEFT_SPEED, IW_ID_LEFT_STATUS, IW_ID_LEFT_FORCE,
                                    IW_ID_NO_POSE,    IW_ID_LEFT_OFFSET, IW_ID_LEFT_SETPOINT};
static const uint8_t lengths[] = {IW_DLC_SPEED, IW_DLC_STATUS, IW_DLC_FORCE,
                                  IW_DLC_POSE,  IW_DLC_OFFSET, IW_DLC_SETPOINT};
#define KINDS (sizeof left_ids / sizeof left_ids[0])

static void get_status(const uint8_t *data, iw_proto_status_t *out_status) {
    out_status->battery_dV = data[BATTERY];
    out_status->temperature_degC = data[TEMPERATURE];
    out_status->odometry_ticks = iw_be_get_i32(&data[ODOMETRY]);
    out_status->cpu_percent = data[CPU];
}

static void get_pose(const uint8_t *data, iw_proto_pose_t *out_pose) {
    out_pose->x_mm = iw_be_get_i16(&data[0]);
    out_pose->y_mm = iw_be_get_i16(&data[2]);
    out_pose->z_mm = iw_be_get_i16(&data[4]);
    out_pose->psi_mrad = iw_be_get_i16(&data[6]);
}

static void get_other(const iw_can_frame_t *frame, size_t kind, iw_proto_message_t *out_message) {
    const uint8_t *const data = frame->data;
    switch (kind) {
    case IW_PROTO_STATUS:
        get_status(data, &out_message->as.status);
        break;
    case IW_PROTO_FORCE:
        out_message->as.force.force_raw = iw_be_get_i16(&data[0]);
        out_message->as.force.debug_raw = iw_be_get_i16(&data[2]);
        break;
    case IW_PROTO_POSE:
        get_pose(data, &out_message->as.pose);
        break;
    case IW_PROTO_OFFSET:
        out_message->as.offset.offset_dN = iw_be_get_i16(&data[0]);
        break;
    case IW_PROTO_SETPOINT:
    default:
        iw_proto_get_setpoint(frame, &out_message->as.setpoint);
        break;
    }
}

iw_status_t iw_proto_decode_other(const iw_can_frame_t *frame, iw_proto_message_t *out_message) {
    const uint32_t number = frame->id & ~FORMAT_BITS;
    size_t kind = 0;
    while (left_ids[kind] != (number & ~IW_PROTO_SIDE_BIT)) {
        kind++;
        if (kind == KINDS) {
            return IW_ERR_ID;
        }
    }
    if (number == IW_ID_NO_POSE) {
        return IW_ERR_ID;
    }
    if (number != frame->id) {
        return IW_ERR_FORMAT;
    }
    if (frame->dlc < lengths[kind] || frame->dlc > IW_CAN_DATA_MAX) {
        return IW_ERR_LENGTH;
    }
    out_message->kind = (iw_proto_kind_t)kind;
    out_message->side = (iw_side_t)((number >> IW_PROTO_SIDE_SHIFT) & 1U);
    get_other(frame, kind, out_message);
    return IW_OK;
}

static void start_frame(iw_can_frame_t *out_frame, uint32_t id, uint8_t dlc) {
    memset(out_frame, 0, sizeof *out_frame);
    out_frame->id = id;
    out_frame->dlc = dlc;
}

bool iw_proto_encode_setpoint(iw_side_t side, const iw_proto_setpoint_t *setpoint, uint8_t dlc,
                              iw_can_frame_t *out_frame) {
    int32_t current_mA = setpoint->current_mA;
    const bool clamped = (uint32_t)(current_mA + IW_CURRENT_LIMIT_mA) > 2U * IW_CURRENT_LIMIT_mA;
    if (clamped) {
        current_mA = (current_mA < 0) ? -IW_CURRENT_LIMIT_mA : IW_CURRENT_LIMIT_mA;
    }
    out_frame->id = IW_ID_LEFT_SETPOINT + ((uint32_t)side << IW_PROTO_SIDE_SHIFT);
    out_frame->data[0] = setpoint->type;
    iw_be_put_i16(&out_frame->data[1], setpoint->speed_mm_s);
    iw_be_put_i16(&out_frame->data[3], (int16_t)current_mA);
    out_frame->data[5] = 0;
    out_frame->data[6] = 0;
    out_frame->data[7] = 0;
    out_frame->dlc = dlc;
    out_frame->kind = IW_CAN_RECEIVED;
    return clamped;
}

static void put_status(uint8_t *data, const iw_proto_status_t *status) {
    data[BATTERY] = status->battery_dV;
    data[TEMPERATURE] = status->temperature_degC;
    iw_be_put_i32(&data[ODOMETRY], status->odometry_ticks);
    data[CPU] = status->cpu_percent;
}

static void put_pose(uint8_t *data, const iw_proto_pose_t *pose) {
    iw_be_put_i16(&data[0], pose->x_mm);
    iw_be_put_i16(&data[2], pose->y_mm);
    iw_be_put_i16(&data[4], pose->z_mm);
    iw_be_put_i16(&data[6], pose->psi_mrad);
}

iw_status_t iw_proto_encode(const iw_proto_message_t *message, iw_can_frame_t *out_frame) {
    uint8_t *const data = out_frame->data;
    const uint32_t id = left_ids[message->kind] + ((uint32_t)message->side << IW_PROTO_SIDE_SHIFT);
    if (id == IW_ID_NO_POSE) {
        return IW_ERR_ID;
    }
    start_frame(out_frame, id, lengths[message->kind]);
    switch (message->kind) {
    case IW_PROTO_SETPOINT:
        (void)iw_proto_encode_setpoint(message->side, &message->as.setpoint, IW_DLC_SETPOINT, out_frame);
        break;
    case IW_PROTO_SPEED:
        iw_be_put_i16(&data[0], message->as.speed.speed_rpm);
        iw_be_put_i16(&data[2], message->as.speed.acceleration_raw);
        break;
    case IW_PROTO_STATUS:
        put_status(data, &message->as.status);
        break;
    case IW_PROTO_POSE:
        put_pose(data, &message->as.pose);
        break;
    case IW_PROTO_FORCE:
        iw_be_put_i16(&data[0], message->as.force.force_raw);
        iw_be_put_i16(&data[2], message->as.force.debug_raw);
        break;
    case IW_PROTO_OFFSET:
    default:
        iw_be_put_i16(&data[0], message->as.offset.offset_dN);
        break;
    }
    return IW_OK;
}
