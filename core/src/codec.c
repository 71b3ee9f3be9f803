// SPDX-License-Identifier: MIT
#include "iwheel/codec.h"

#include "arithmetic.h"
#include "be.h"

#include <string.h>

/// Bits of the id word besides the 11-bit id: the format.
#define FORMAT_BITS (IW_CAN_EXTENDED | IW_CAN_REMOTE | IW_CAN_ERROR | IW_CAN_FD)

/// The only bit that differs between the ids of the two wheels.
#define SIDE_BIT 0x20U

const iw_codec_row_t iw_codec_rows[IW_CODEC_ROWS] = {
    {IW_ID_LEFT_SPEED, 4, IW_DLC_SPEED, IW_CODEC_SPEED, IW_LEFT},
    {IW_ID_RIGHT_SPEED, 4, IW_DLC_SPEED, IW_CODEC_SPEED, IW_RIGHT},
    {IW_ID_LEFT_STATUS, 40, IW_DLC_STATUS, IW_CODEC_STATUS, IW_LEFT},
    {IW_ID_RIGHT_STATUS, 40, IW_DLC_STATUS, IW_CODEC_STATUS, IW_RIGHT},
    {IW_ID_LEFT_FORCE, 50, IW_DLC_FORCE, IW_CODEC_FORCE, IW_LEFT},
    {IW_ID_RIGHT_FORCE, 50, IW_DLC_FORCE, IW_CODEC_FORCE, IW_RIGHT},
    {IW_ID_LEFT_OFFSET, 1000, IW_DLC_OFFSET, IW_CODEC_OFFSET, IW_LEFT},
    {IW_ID_RIGHT_OFFSET, 1000, IW_DLC_OFFSET, IW_CODEC_OFFSET, IW_RIGHT},
    {IW_ID_LEFT_SETPOINT, 1000, IW_DLC_SETPOINT, IW_CODEC_SETPOINT, IW_LEFT},
    {IW_ID_RIGHT_SETPOINT, 1000, IW_DLC_SETPOINT, IW_CODEC_SETPOINT, IW_RIGHT},
    {IW_ID_RIGHT_POSE, 40, IW_DLC_POSE, IW_CODEC_POSE, IW_RIGHT},
};

const char *iw_codec_name(iw_codec_kind_t kind) {
    static const char *const names[] = {"speed", "status", "force", "offset", "setpoint", "pose"};
    return names[kind];
}

iw_side_t iw_codec_side(uint32_t id) {
    return ((id & SIDE_BIT) == 0U) ? IW_LEFT : IW_RIGHT;
}

uint8_t iw_codec_length(iw_codec_kind_t kind) {
    static const uint8_t lengths[IW_CODEC_KINDS] = {
        [IW_CODEC_SPEED] = IW_DLC_SPEED,   [IW_CODEC_STATUS] = IW_DLC_STATUS,     [IW_CODEC_FORCE] = IW_DLC_FORCE,
        [IW_CODEC_OFFSET] = IW_DLC_OFFSET, [IW_CODEC_SETPOINT] = IW_DLC_SETPOINT, [IW_CODEC_POSE] = IW_DLC_POSE,
    };
    return lengths[kind];
}

const iw_codec_row_t *iw_codec_find(uint32_t id) {
    for (size_t i = 0; i < IW_CODEC_ROWS; i++) {
        if (iw_codec_rows[i].id == id) {
            return &iw_codec_rows[i];
        }
    }
    return NULL;
}

/// Returns true if `length` is in `least`..8. One comparison covers both limits.
static bool fits(uint32_t length, uint32_t least) {
    return length - least <= IW_CAN_DATA_MAX - least;
}

/// Reason for a length that does not fit; it includes the format bits of the frame.
static iw_codec_kind_t refusal(uint32_t length) {
    return ((length & FORMAT_BITS) != 0U) ? IW_CODEC_BAD_FORMAT : IW_CODEC_BAD_LENGTH;
}

/// The odometry spans both words.
static iw_codec_kind_t read_status(const iw_can_frame_t *frame, uint32_t length, iw_codec_status_t *out_status) {
    if (!fits(length, IW_DLC_STATUS)) {
        return refusal(length);
    }
    const uint32_t first = iw_be_word(frame, 0);
    const uint32_t second = iw_be_word(frame, 1);
    out_status->odometry_ticks = (int32_t)((first << 16) | (second >> 16));
    out_status->battery_dV = (uint8_t)(first >> 24);
    out_status->temperature_degC = (uint8_t)((first >> 16) & 0xFFU);
    out_status->cpu_percent = (uint8_t)((second >> 8) & 0xFFU);
    return IW_CODEC_STATUS;
}

static iw_codec_kind_t read_force(const iw_can_frame_t *frame, uint32_t length, iw_codec_force_t *out_force) {
    if (!fits(length, IW_DLC_FORCE)) {
        return refusal(length);
    }
    const uint32_t word = iw_be_word(frame, 0);
    out_force->debug_raw = iw_be_low_i16(word);
    out_force->force_raw = iw_be_low_i16(word >> 16);
    return IW_CODEC_FORCE;
}

static iw_codec_kind_t read_pose(const iw_can_frame_t *frame, uint32_t length, iw_codec_pose_t *out_pose) {
    if (!fits(length, IW_DLC_POSE)) {
        return refusal(length);
    }
    const uint32_t first = iw_be_word(frame, 0);
    const uint32_t second = iw_be_word(frame, 1);
    out_pose->x_mm = iw_be_low_i16(first >> 16);
    out_pose->y_mm = iw_be_low_i16(first);
    out_pose->z_mm = iw_be_low_i16(second >> 16);
    out_pose->psi_mrad = iw_be_low_i16(second);
    return IW_CODEC_POSE;
}

static iw_codec_kind_t read_setpoint(const iw_can_frame_t *frame, uint32_t length, iw_codec_setpoint_t *out_setpoint) {
    if (!fits(length, IW_DLC_SETPOINT)) {
        return refusal(length);
    }
    const uint32_t first = iw_be_word(frame, 0);
    out_setpoint->speed_mm_s = iw_be_low_i16(first >> 8);
    out_setpoint->current_mA = iw_be_low_i16((first << 8) | (iw_be_word(frame, 1) >> 24));
    out_setpoint->type = (uint8_t)(first >> 24);
    return IW_CODEC_SETPOINT;
}

static iw_codec_kind_t read_offset(const iw_can_frame_t *frame, uint32_t length, iw_codec_offset_t *out_offset) {
    if (!fits(length, IW_DLC_OFFSET)) {
        return refusal(length);
    }
    out_offset->offset_dN = iw_be_low_i16(iw_be_word(frame, 0) >> 16);
    return IW_CODEC_OFFSET;
}

/// Decodes every message except a valid speed, the most frequent first. It is a separate function so that the speed
/// message, four frames of five, saves no registers. It receives both wheels, so that the caller needs no pointer to
/// one of them before the frame is valid.
static IW_APART iw_codec_kind_t read_other(const iw_can_frame_t *frame, iw_codec_wheel_t *wheel) {
    iw_codec_wheel_t *const self = &wheel[iw_codec_side(frame->id)];
    const uint32_t number = frame->id & ~(FORMAT_BITS | SIDE_BIT);
    // A format bit in the length makes every length invalid: the same comparison refuses a remote or extended frame
    // with a known id, without a second search of the table.
    const uint32_t length = frame->dlc | (frame->id & FORMAT_BITS);
    if (number == IW_ID_LEFT_STATUS) {
        return read_status(frame, length, &self->status);
    }
    if (number == IW_ID_LEFT_FORCE) {
        return read_force(frame, length, &self->force);
    }
    if (number == IW_ID_RIGHT_POSE - SIDE_BIT && (frame->id & SIDE_BIT) != 0U) {
        return read_pose(frame, length, &self->pose);
    }
    if (number == IW_ID_LEFT_OFFSET) {
        return read_offset(frame, length, &self->offset);
    }
    if (number == IW_ID_LEFT_SETPOINT) {
        return read_setpoint(frame, length, &self->setpoint);
    }
    return (number == IW_ID_LEFT_SPEED) ? refusal(length) : IW_CODEC_UNKNOWN;
}

iw_codec_kind_t iw_codec_decode(const iw_can_frame_t *frame, iw_codec_wheel_t wheel[IW_SIDES]) {
    const uint32_t id = frame->id;
    if ((id & ~SIDE_BIT) == IW_ID_LEFT_SPEED && fits(frame->dlc, IW_DLC_SPEED)) { // Four of five frames.
        const uint32_t word = iw_be_word(frame, 0);
        // Assigned as a whole, in its memory layout: gcc and clang make one store of it.
        const iw_codec_speed_t speed = {iw_be_low_i16(word), iw_be_low_i16(word >> 16)};
        wheel[iw_codec_side(id)].speed = speed;
        return IW_CODEC_SPEED;
    }
    return read_other(frame, wheel);
}

static void put_status(iw_can_frame_t *out_frame, const iw_codec_status_t *status) {
    const uint32_t ticks = (uint32_t)status->odometry_ticks;
    iw_be_put_word(out_frame, 0,
                   ((uint32_t)status->battery_dV << 24) | ((uint32_t)status->temperature_degC << 16) | (ticks >> 16));
    iw_be_put_word(out_frame, 1, (ticks << 16) | ((uint32_t)status->cpu_percent << 8));
}

iw_status_t iw_codec_encode(iw_codec_kind_t kind, iw_side_t side, const iw_codec_wheel_t *wheel,
                            iw_can_frame_t *out_frame) {
    size_t i = 0;
    while (i < IW_CODEC_ROWS && (iw_codec_rows[i].kind != (uint8_t)kind || iw_codec_rows[i].side != (uint8_t)side)) {
        i++;
    }
    if (i == IW_CODEC_ROWS) {
        return IW_ERR_ID;
    }
    memset(out_frame, 0, sizeof *out_frame);
    out_frame->id = iw_codec_rows[i].id;
    out_frame->dlc = iw_codec_rows[i].length;
    switch (kind) {
    case IW_CODEC_SPEED:
        iw_be_put_word(out_frame, 0, iw_be_join(wheel->speed.speed_rpm, wheel->speed.acceleration_raw));
        break;
    case IW_CODEC_STATUS:
        put_status(out_frame, &wheel->status);
        break;
    case IW_CODEC_FORCE:
        iw_be_put_word(out_frame, 0, iw_be_join(wheel->force.force_raw, wheel->force.debug_raw));
        break;
    case IW_CODEC_POSE:
        iw_be_put_word(out_frame, 0, iw_be_join(wheel->pose.x_mm, wheel->pose.y_mm));
        iw_be_put_word(out_frame, 1, iw_be_join(wheel->pose.z_mm, wheel->pose.psi_mrad));
        break;
    case IW_CODEC_OFFSET:
        iw_be_put_word(out_frame, 0, iw_be_join(wheel->offset.offset_dN, 0));
        break;
    default:
        (void)iw_codec_encode_setpoint(side, &wheel->setpoint, IW_DLC_SETPOINT, out_frame);
        break;
    }
    return IW_OK;
}

bool iw_codec_encode_setpoint(iw_side_t side, const iw_codec_setpoint_t *setpoint, uint8_t dlc,
                              iw_can_frame_t *out_frame) {
    // The last check of the current: limits and envelope have checked it before.
    int32_t current_mA = setpoint->current_mA;
    const bool clamped = current_mA < -IW_CURRENT_LIMIT_mA || current_mA > IW_CURRENT_LIMIT_mA;
    if (clamped) {
        current_mA = (current_mA < 0) ? -IW_CURRENT_LIMIT_mA : IW_CURRENT_LIMIT_mA;
    }
    out_frame->id = IW_ID_LEFT_SETPOINT + SIDE_BIT * (uint32_t)side;
    out_frame->dlc = dlc;
    out_frame->kind = IW_CAN_RECEIVED;
    const uint32_t both = iw_be_join(setpoint->speed_mm_s, (int16_t)current_mA);
    iw_be_put_word(out_frame, 0, ((uint32_t)setpoint->type << 24) | (both >> 8));
    iw_be_put_word(out_frame, 1, both << 24);
    return clamped;
}
