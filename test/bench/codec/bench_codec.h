// SPDX-License-Identifier: MIT
/// What every codec in the comparison does with a frame: look at its id and length, and store its values in its own form.
#ifndef BENCH_CODEC_H
#define BENCH_CODEC_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

/// The values of a setpoint, as a program has them.
typedef struct {
    int16_t speed_mm_s;
    int16_t current_mA;
    uint8_t type;
} bench_setpoint_t;

/// `rounds` times the frames of one second of a nominal bus. Returns how many were refused: none. One function, so that a codec may be
/// compiled into it as into a program.
uint32_t bench_decode(uint32_t rounds);

/// `rounds` times a complete frame with the setpoint of either wheel in turn.
uint32_t bench_encode(uint32_t rounds);

/// One second of a nominal bus, shuffled by a fixed rule: 500 speeds, 50 status, 40 forces, 25 poses, 2 offsets.
#define BENCH_FRAMES 617U
extern iw_can_frame_t bench_frame[BENCH_FRAMES];
extern volatile bench_setpoint_t bench_setpoint;
void bench_fill(void);

/// What the pointer leads to must be stored by now, and may be changed by somebody else.
#define BENCH_STORED(pointer) __asm__ volatile("" : : "r"(pointer) : "memory")

#endif
