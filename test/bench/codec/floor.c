// SPDX-License-Identifier: MIT
/// The leanest program that reads these frames: ids are compared in the order of their frequency, and values are stored at their destination,
/// without side, kind or remote frames. The cost of a codec beyond this is the price of its generality.
#include "bench_codec.h"

typedef struct {
    int16_t first;
    int16_t second;
} two_t;

static struct {
    two_t speed[IW_SIDES];
    two_t force[IW_SIDES];
    int32_t ticks[IW_SIDES];
    uint8_t status[IW_SIDES][3];
    int16_t pose[4];
    int16_t offset[IW_SIDES];
} seen;
static iw_can_frame_t encoded;

__attribute__((always_inline)) static inline int16_t word(const uint8_t *bytes) {
    return (int16_t)(uint16_t)(((uint32_t)bytes[0] << 8) | bytes[1]);
}

__attribute__((always_inline)) static inline void put_long(uint8_t *bytes, uint32_t value) {
    bytes[0] = (uint8_t)(value >> 24);
    bytes[1] = (uint8_t)((value >> 16) & 0xFFU);
    bytes[2] = (uint8_t)((value >> 8) & 0xFFU);
    bytes[3] = (uint8_t)(value & 0xFFU);
}

__attribute__((always_inline)) static inline void two(const iw_can_frame_t *frame, two_t *out_two) {
    out_two->first = word(&frame->data[0]);
    out_two->second = word(&frame->data[2]);
}

__attribute__((always_inline)) static inline void status(const iw_can_frame_t *frame, uint32_t side) {
    seen.status[side][0] = frame->data[0];
    seen.status[side][1] = frame->data[1];
    seen.status[side][2] = frame->data[6];
    seen.ticks[side] = (int32_t)(((uint32_t)frame->data[2] << 24) | ((uint32_t)frame->data[3] << 16) |
                                 ((uint32_t)frame->data[4] << 8) | frame->data[5]);
}

__attribute__((always_inline)) static inline void pose(const iw_can_frame_t *frame) {
    for (uint32_t i = 0; i < 4U; i++) {
        seen.pose[i] = word(&frame->data[2U * i]);
    }
}

uint32_t bench_decode(uint32_t rounds) {
    uint32_t refused = 0;
    for (uint32_t round = 0; round < rounds; round++) {
        for (const iw_can_frame_t *frame = bench_frame; frame < &bench_frame[BENCH_FRAMES]; frame++) {
            if (frame->id == 0x100U && frame->dlc >= 4U) {
                two(frame, &seen.speed[IW_LEFT]);
            } else if (frame->id == 0x120U && frame->dlc >= 4U) {
                two(frame, &seen.speed[IW_RIGHT]);
            } else if (frame->id == 0x101U && frame->dlc >= 7U) {
                status(frame, IW_LEFT);
            } else if (frame->id == 0x121U && frame->dlc >= 7U) {
                status(frame, IW_RIGHT);
            } else if (frame->id == 0x122U && frame->dlc >= 8U) {
                pose(frame);
            } else if (frame->id == 0x200U && frame->dlc >= 4U) {
                two(frame, &seen.force[IW_LEFT]);
            } else if (frame->id == 0x220U && frame->dlc >= 4U) {
                two(frame, &seen.force[IW_RIGHT]);
            } else if (frame->id == 0x201U && frame->dlc >= 2U) {
                seen.offset[IW_LEFT] = word(frame->data);
            } else if (frame->id == 0x221U && frame->dlc >= 2U) {
                seen.offset[IW_RIGHT] = word(frame->data);
            } else {
                refused++;
            }
            BENCH_STORED(&seen);
        }
    }
    return refused;
}

uint32_t bench_encode(uint32_t rounds) {
    for (uint32_t i = 0; i < rounds; i++) {
        const bench_setpoint_t setpoint = {bench_setpoint.speed_mm_s, bench_setpoint.current_mA, bench_setpoint.type};
        encoded.id = ((i & 1U) == 0U) ? 0x10AU : 0x12AU;
        encoded.dlc = 5;
        const uint16_t current = (uint16_t)setpoint.current_mA;
        put_long(&encoded.data[0], ((uint32_t)setpoint.type << 24) | ((uint32_t)(uint16_t)setpoint.speed_mm_s << 8) |
                                       ((uint32_t)current >> 8));
        encoded.data[4] = (uint8_t)(current & 0xFFU);
        BENCH_STORED(&encoded);
    }
    return 0;
}
