// SPDX-License-Identifier: MIT
/// Queue of frames from interrupts to the main loop.
///
/// It has one producer and one consumer: interrupts of equal priority add frames, the main loop removes them. It
/// needs no lock, because only one side writes each index. At most 21 frames arrive per millisecond at 1 Mbit/s, so the
/// ring has space for 3 ms of a full bus.
#ifndef BRD_FRAME_RING_H
#define BRD_FRAME_RING_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#include <stdatomic.h>

#define BRD_FRAME_RING_LENGTH 64U ///< A power of two.

typedef struct {
    iw_can_frame_t frame[BRD_FRAME_RING_LENGTH];
    uint8_t tag[BRD_FRAME_RING_LENGTH]; ///< Tag of the producer, returned with the frame.
    atomic_uint head;                   ///< Number of frames put in since the start; written by the producer.
    atomic_uint tail;                   ///< Number of frames removed since the start; written by the consumer.
} brd_frame_ring_t;

/// Call it from an interrupt. Returns false if the ring is full: the frame is lost, and the caller must count it.
bool brd_frame_ring_put(brd_frame_ring_t *self, const iw_can_frame_t *frame, uint8_t tag);

/// Call it from the main loop. Returns false and leaves the outputs unchanged if the ring is empty.
bool brd_frame_ring_take(brd_frame_ring_t *self, iw_can_frame_t *out_frame, uint8_t *out_tag);

#endif
