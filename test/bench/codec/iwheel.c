// SPDX-License-Identifier: MIT
#include "bench_codec.h"
#include "iwheel/codec.h"

static iw_codec_wheel_t seen[IW_SIDES]; // The latest of each message, stored per wheel, as a program needs them.
static iw_can_frame_t encoded;

uint32_t bench_decode(uint32_t rounds) {
    uint32_t refused = 0;
    for (uint32_t round = 0; round < rounds; round++) {
        for (const iw_can_frame_t *frame = bench_frame; frame < &bench_frame[BENCH_FRAMES]; frame++) {
            refused += (iw_codec_decode(frame, seen) < IW_CODEC_KINDS) ? 0U : 1U;
            BENCH_STORED(seen);
        }
    }
    return refused;
}

uint32_t bench_encode(uint32_t rounds) {
    uint32_t clamped = 0;
    for (uint32_t i = 0; i < rounds; i++) {
        const iw_codec_setpoint_t setpoint = {bench_setpoint.speed_mm_s, bench_setpoint.current_mA,
                                              bench_setpoint.type};
        clamped += iw_codec_encode_setpoint((iw_side_t)(i & 1U), &setpoint, IW_DLC_SETPOINT, &encoded) ? 1U : 0U;
        BENCH_STORED(&encoded);
    }
    return clamped;
}
