// SPDX-License-Identifier: MIT
#include "bench_codec.h"

#define MULTIPLIER 1103515245U
#define INCREMENT  12345U

iw_can_frame_t bench_frame[BENCH_FRAMES];
volatile bench_setpoint_t bench_setpoint = {500, 2000, 1};

static const struct {
    uint16_t id;
    uint8_t dlc;
    uint8_t per_second;
} mix[] = {
    {0x100, 4, 250}, {0x120, 4, 250}, {0x101, 7, 25}, {0x121, 7, 25}, {0x122, 8, 25},
    {0x200, 4, 20},  {0x220, 4, 20},  {0x201, 2, 1},  {0x221, 2, 1},
};

static void shuffle(void) {
    uint32_t state = 1;
    for (uint32_t i = BENCH_FRAMES - 1U; i > 0U; i--) {
        state = state * MULTIPLIER + INCREMENT;
        const uint32_t other = (state >> 8) % (i + 1U);
        const iw_can_frame_t frame = bench_frame[i];
        bench_frame[i] = bench_frame[other];
        bench_frame[other] = frame;
    }
}

void bench_fill(void) {
    uint32_t at = 0;
    for (uint32_t kind = 0; kind < sizeof mix / sizeof mix[0]; kind++) {
        for (uint32_t i = 0; i < mix[kind].per_second; i++) {
            bench_frame[at].id = mix[kind].id;
            bench_frame[at].dlc = mix[kind].dlc;
            for (uint32_t byte = 0; byte < IW_CAN_DATA_MAX; byte++) {
                bench_frame[at].data[byte] = (uint8_t)(at * 7U + byte * 31U);
            }
            at++;
        }
    }
    shuffle();
}
