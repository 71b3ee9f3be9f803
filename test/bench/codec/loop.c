// SPDX-License-Identifier: MIT
/// The loops of the benchmark without a codec: each frame is skipped; a setpoint's three values and its side are read. Their count is
/// subtracted, because it is not the codec's.
#include "bench_codec.h"

uint32_t bench_decode(uint32_t rounds) {
    for (uint32_t round = 0; round < rounds; round++) {
        for (const iw_can_frame_t *frame = bench_frame; frame < &bench_frame[BENCH_FRAMES]; frame++) {
            BENCH_STORED(frame);
        }
    }
    return 0;
}

uint32_t bench_encode(uint32_t rounds) {
    for (uint32_t i = 0; i < rounds; i++) {
        const bench_setpoint_t setpoint = {bench_setpoint.speed_mm_s, bench_setpoint.current_mA, bench_setpoint.type};
        __asm__ volatile("" : : "r"(setpoint.speed_mm_s), "r"(setpoint.current_mA), "r"(setpoint.type), "r"(i & 1U));
    }
    return 0;
}
