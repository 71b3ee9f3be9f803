// SPDX-License-Identifier: MIT
/// The work of every codec in the comparison for a frame: check its id and length, and store its values in the codec's own form.
#ifndef BENCH_CODEC_H
#define BENCH_CODEC_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

/// The values of a setpoint in the form of a program.
typedef struct {
    int16_t speed_mm_s;
    int16_t current_mA;
    uint8_t type;
} bench_setpoint_t;

/// Decodes the frames of one second of a nominal bus `rounds` times. Returns the number of refused frames: none. It is one function, so a
/// compiler may inline a codec as in a program.
uint32_t bench_decode(uint32_t rounds);

/// Encodes a complete frame with the setpoint of either wheel in turn, `rounds` times.
uint32_t bench_encode(uint32_t rounds);

/// One second of a nominal bus, shuffled by a fixed rule: 500 speeds, 50 status, 40 forces, 25 poses, 2 offsets.
#define BENCH_FRAMES 617U
extern iw_can_frame_t bench_frame[BENCH_FRAMES];
extern volatile bench_setpoint_t bench_setpoint;
void bench_fill(void);

/// Forces a store of the memory behind the pointer; the compiler must assume that the memory changes.
#define BENCH_STORED(pointer) __asm__ volatile("" : : "r"(pointer) : "memory")

#endif
