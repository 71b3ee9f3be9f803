// SPDX-License-Identifier: MIT
#include "iwheel/proto.h"

#include "be.h"

#include <string.h>

#define FORMAT_BITS (IW_CAN_EXTENDED | IW_CAN_REMOTE | IW_CAN_ERROR | IW_CAN_FD)
#define BATTERY     0
#define TEMPERATURE 1
#define ODOMETRY    2
#define CPU         6

typedef struct {
    uint16_t id;
    uint8_t dlc;
    uint8_t kind;
    uint8_t side;
} layout_t;

/// In the order in which a nominal bus brings them.
static const layout_t layouts[] = {
    {IW_ID_LEFT_SPEED, IW_DLC_SPEED, IW_PROTO_SPEED, IW_LEFT},
    {IW_ID_RIGHT_SPEED, IW_DLC_SPEED, IW_PROTO_SPEED, IW_RIGHT},
    {IW_ID_LEFT_SETPOINT, IW_DLC_SETPOINT, IW_PROTO_SETPOINT, IW_LEFT},
    {IW_ID_RIGHT_SETPOINT, IW_DLC_SETPOINT, IW_PROTO_SETPOINT, IW_RIGHT},
    {IW_ID_LEFT_STATUS, IW_DLC_STATUS, IW_PROTO_STATUS, IW_LEFT},
    {IW_ID_RIGHT_STATUS, IW_DLC_STATUS, IW_PROTO_STATUS, IW_RIGHT},
    {IW_ID_RIGHT_POSE, IW_DLC_POSE, IW_PROTO_POSE, IW_RIGHT},
    {IW_ID_LEFT_FORCE, IW_DLC_FORCE, IW_PROTO_FORCE, IW_LEFT},
    {IW_ID_RIGHT_FORCE, IW_DLC_FORCE, IW_PROTO_FORCE, IW_RIGHT},
    {IW_ID_LEFT_OFFSET, IW_DLC_OFFSET, IW_PROTO_OFFSET, IW_LEFT},
    {IW_ID_RIGHT_OFFSET, IW_DLC_OFFSET, IW_PROTO_OFFSET, IW_RIGHT},
};
#define LAYOUTS (sizeof layouts / sizeof layouts[0])

static const layout_t *find_id(uint32_t id) {
    for (size_t i = 0; i < LAYOUTS; i++) {
        if (layouts[i].id == id) {
            return &layouts[i];
        }
    }
    return NULL;
}

static const layout_t *find_message(iw_proto_kind_t kind, iw_side_t side) {
    for (size_t i = 0; i < LAYOUTS; i++) {
        if (layouts[i].kind == (uint8_t)kind && layouts[i].side == (uint8_t)side) {
            return &layouts[i];
        }
    }
    return NULL;
}

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

static void get_message(const uint8_t *data, iw_proto_message_t *out_message) {
    switch (out_message->kind) {
    case IW_PROTO_SETPOINT:
        out_message->as.setpoint.type = data[0];
        out_message->as.setpoint.speed_mm_s = iw_be_get_i16(&data[1]);
        out_message->as.setpoint.current_mA = iw_be_get_i16(&data[3]);
        break;
    case IW_PROTO_SPEED:
        out_message->as.speed.speed_rpm = iw_be_get_i16(&data[0]);
        out_message->as.speed.acceleration_raw = iw_be_get_i16(&data[2]);
        break;
    case IW_PROTO_STATUS:
        get_status(data, &out_message->as.status);
        break;
    case IW_PROTO_POSE:
        get_pose(data, &out_message->as.pose);
        break;
    case IW_PROTO_FORCE:
        out_message->as.force.force_raw = iw_be_get_i16(&data[0]);
        out_message->as.force.debug_raw = iw_be_get_i16(&data[2]);
        break;
    case IW_PROTO_OFFSET:
    default:
        out_message->as.offset.offset_dN = iw_be_get_i16(&data[0]);
        break;
    }
}

iw_status_t iw_proto_decode(const iw_can_frame_t *frame, iw_proto_message_t *out_message) {
    const layout_t *const layout = find_id(frame->id & ~FORMAT_BITS);
    if (layout == NULL) {
        return IW_ERR_ID;
    }
    if ((frame->id & FORMAT_BITS) != 0U) {
        return IW_ERR_FORMAT;
    }
    if (frame->dlc < layout->dlc || frame->dlc > IW_CAN_DATA_MAX) {
        return IW_ERR_LENGTH;
    }
    out_message->kind = (iw_proto_kind_t)layout->kind;
    out_message->side = (iw_side_t)layout->side;
    get_message(frame->data, out_message);
    return IW_OK;
}

static void start_frame(iw_can_frame_t *out_frame, uint32_t id, uint8_t dlc) {
    memset(out_frame, 0, sizeof *out_frame);
    out_frame->id = id;
    out_frame->dlc = dlc;
}

bool iw_proto_encode_setpoint(iw_side_t side, const iw_proto_setpoint_t *setpoint, uint8_t dlc,
                              iw_can_frame_t *out_frame) {
    int16_t current_mA = setpoint->current_mA;
    if (current_mA > IW_CURRENT_LIMIT_mA) {
        current_mA = IW_CURRENT_LIMIT_mA;
    }
    if (current_mA < -IW_CURRENT_LIMIT_mA) {
        current_mA = -IW_CURRENT_LIMIT_mA;
    }
    start_frame(out_frame, (side == IW_LEFT) ? IW_ID_LEFT_SETPOINT : IW_ID_RIGHT_SETPOINT, dlc);
    out_frame->data[0] = setpoint->type;
    iw_be_put_i16(&out_frame->data[1], setpoint->speed_mm_s);
    iw_be_put_i16(&out_frame->data[3], current_mA);
    return current_mA != setpoint->current_mA;
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
    const layout_t *const layout = find_message(message->kind, message->side);
    if (layout == NULL) {
        return IW_ERR_ID;
    }
    start_frame(out_frame, layout->id, layout->dlc);
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
