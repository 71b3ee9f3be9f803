// SPDX-License-Identifier: MIT
/// The C source that cantools generates from share/iwheel.dbc during the run, with the selection by id that its user must write.
#include "bench_codec.h"
#include "iwheel.h"

static struct {
    struct iwheel_left_speed_t left_speed;
    struct iwheel_right_speed_t right_speed;
    struct iwheel_left_status_t left_status;
    struct iwheel_right_status_t right_status;
    struct iwheel_right_pose_t pose;
    struct iwheel_left_force_t left_force;
    struct iwheel_right_force_t right_force;
    struct iwheel_left_offset_t left_offset;
    struct iwheel_right_offset_t right_offset;
} seen;
static iw_can_frame_t encoded;

static int unpack(const iw_can_frame_t *frame) {
    switch (frame->id) {
    case IWHEEL_LEFT_SPEED_FRAME_ID:
        return iwheel_left_speed_unpack(&seen.left_speed, frame->data, frame->dlc);
    case IWHEEL_RIGHT_SPEED_FRAME_ID:
        return iwheel_right_speed_unpack(&seen.right_speed, frame->data, frame->dlc);
    case IWHEEL_LEFT_STATUS_FRAME_ID:
        return iwheel_left_status_unpack(&seen.left_status, frame->data, frame->dlc);
    case IWHEEL_RIGHT_STATUS_FRAME_ID:
        return iwheel_right_status_unpack(&seen.right_status, frame->data, frame->dlc);
    case IWHEEL_RIGHT_POSE_FRAME_ID:
        return iwheel_right_pose_unpack(&seen.pose, frame->data, frame->dlc);
    case IWHEEL_LEFT_FORCE_FRAME_ID:
        return iwheel_left_force_unpack(&seen.left_force, frame->data, frame->dlc);
    case IWHEEL_RIGHT_FORCE_FRAME_ID:
        return iwheel_right_force_unpack(&seen.right_force, frame->data, frame->dlc);
    case IWHEEL_LEFT_OFFSET_FRAME_ID:
        return iwheel_left_offset_unpack(&seen.left_offset, frame->data, frame->dlc);
    case IWHEEL_RIGHT_OFFSET_FRAME_ID:
        return iwheel_right_offset_unpack(&seen.right_offset, frame->data, frame->dlc);
    default:
        return -1;
    }
}

uint32_t bench_decode(uint32_t rounds) {
    uint32_t refused = 0;
    for (uint32_t round = 0; round < rounds; round++) {
        for (const iw_can_frame_t *frame = bench_frame; frame < &bench_frame[BENCH_FRAMES]; frame++) {
            refused += (unpack(frame) == 0) ? 0U : 1U;
            BENCH_STORED(&seen);
        }
    }
    return refused;
}

uint32_t bench_encode(uint32_t rounds) {
    uint32_t refused = 0;
    for (uint32_t i = 0; i < rounds; i++) {
        const bench_setpoint_t setpoint = {bench_setpoint.speed_mm_s, bench_setpoint.current_mA, bench_setpoint.type};
        int packed;
        encoded.dlc = IWHEEL_LEFT_SETPOINT_LENGTH;
        if ((i & 1U) == 0U) {
            const struct iwheel_left_setpoint_t left = {setpoint.type, setpoint.speed_mm_s, setpoint.current_mA};
            encoded.id = IWHEEL_LEFT_SETPOINT_FRAME_ID;
            packed = iwheel_left_setpoint_pack(encoded.data, &left, sizeof encoded.data);
        } else {
            const struct iwheel_right_setpoint_t right = {setpoint.type, setpoint.speed_mm_s, setpoint.current_mA};
            encoded.id = IWHEEL_RIGHT_SETPOINT_FRAME_ID;
            packed = iwheel_right_setpoint_pack(encoded.data, &right, sizeof encoded.data);
        }
        refused += (packed > 0) ? 0U : 1U;
        BENCH_STORED(&encoded);
    }
    return refused;
}
