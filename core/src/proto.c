// SPDX-License-Identifier: MIT
#include "iwheel/proto.h"

#include "iwheel/be.h"

#include <string.h>

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

iw_status_t iw_proto_decode_other(const iw_can_frame_t *frame, iw_proto_message_t *out_message) {
    return iw_proto_read_other(frame, out_message);
}

static void start_frame(iw_can_frame_t *out_frame, uint32_t id, uint8_t dlc) {
    memset(out_frame, 0, sizeof *out_frame);
    out_frame->id = id;
    out_frame->dlc = dlc;
}

static void put_status(uint8_t *data, const iw_proto_status_t *status) {
    data[IW_PROTO_AT_BATTERY] = status->battery_dV;
    data[IW_PROTO_AT_TEMPERATURE] = status->temperature_degC;
    iw_be_put_i32(&data[IW_PROTO_AT_ODOMETRY], status->odometry_ticks);
    data[IW_PROTO_AT_CPU] = status->cpu_percent;
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
