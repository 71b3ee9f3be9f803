// SPDX-License-Identifier: MIT
/// The eleven messages of the iWheel: typed values to frames and back.
///
/// Source of every id, layout, unit and range: the document "CAN Frames for controlling the iWheel". Integers are
/// two's complement, most significant byte first. Pure functions: no state, callable from anywhere, also from an
/// interrupt.
///
/// | id          | message  | DLC | bytes                                                                | period  |
/// |-------------|----------|-----|----------------------------------------------------------------------|---------|
/// | 266 (0x10A) | setpoint | 5   | 0 type u8, 1-2 speed i16 mm/s, 3-4 current i16 mA (to the left)      | < 1 s   |
/// | 298 (0x12A) | setpoint | 5   | same, to the right                                                   | < 1 s   |
/// | 256 (0x100) | speed    | 4   | 0-1 speed i16 rpm, 2-3 acceleration i16, unit unknown (left)         | 4 ms    |
/// | 288 (0x120) | speed    | 4   | same, right                                                          | 4 ms    |
/// | 257 (0x101) | status   | 7   | 0 battery u8 dV, 1 temperature u8 degC, 2-5 odometry i32, 6 CPU u8 % | 40 ms   |
/// | 289 (0x121) | status   | 7   | same, right                                                          | 40 ms   |
/// | 290 (0x122) | pose     | 8   | 0-1 X i16 mm, 2-3 Y, 4-5 Z, 6-7 PSI i16 mrad (the right sends it)    | 40 ms   |
/// | 512 (0x200) | force    | 4   | 0-1 normal force i16 (document: cN), 2-3 debug (left)                | 50 ms   |
/// | 544 (0x220) | force    | 4   | 0-1 normal force i16 (document: dN), 2-3 debug (right)               | 50 ms   |
/// | 513 (0x201) | offset   | 2   | 0-1 force offset i16 dN (left), in the wheel's first 60 s only       | 1000 ms |
/// | 545 (0x221) | offset   | 2   | same, right                                                          | 1000 ms |
#ifndef IW_PROTO_H
#define IW_PROTO_H

#include "iwheel/proto_decode.h"

/// Writes any of the eleven messages, with the table's length, bytes behind it zero, kind IW_CAN_RECEIVED.
/// IW_ERR_ID if the message does not exist (a pose of the left wheel). A setpoint's current is clamped as below.
iw_status_t iw_proto_encode(const iw_proto_message_t *message, iw_can_frame_t *out_frame);

/// Writes a setpoint of `dlc` 5..8 bytes, zero padded. The last line of defence for the current: it is clamped to
/// +/- IW_CURRENT_LIMIT_mA. Returns true if it had to be, which the caller counts.
static inline bool iw_proto_encode_setpoint(iw_side_t side, const iw_proto_setpoint_t *setpoint, uint8_t dlc,
                                            iw_can_frame_t *out_frame) {
    int32_t current_mA = setpoint->current_mA;
    const bool clamped = (uint32_t)(current_mA + IW_CURRENT_LIMIT_mA) > 2U * IW_CURRENT_LIMIT_mA;
    if (clamped) {
        current_mA = (current_mA < 0) ? -IW_CURRENT_LIMIT_mA : IW_CURRENT_LIMIT_mA;
    }
    const uint32_t current = (uint16_t)current_mA;
    out_frame->id = IW_ID_LEFT_SETPOINT + ((uint32_t)side << IW_PROTO_SIDE_SHIFT);
    iw_be_put_u32(&out_frame->data[0],
                  ((uint32_t)setpoint->type << 24) | ((uint32_t)(uint16_t)setpoint->speed_mm_s << 8) | (current >> 8));
    iw_be_put_u32(&out_frame->data[4], current << 24);
    out_frame->dlc = dlc;
    out_frame->kind = IW_CAN_RECEIVED;
    return clamped;
}

#endif
