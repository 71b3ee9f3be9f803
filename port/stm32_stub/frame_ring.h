// SPDX-License-Identifier: MIT
/// A queue of frames between interrupts and the main loop.
///
/// One producer, one consumer: interrupts of equal priority put frames in, the main loop takes them out. No lock: each
/// index is written by one side only. At most 21 frames come in a millisecond at 1 Mbit/s, so the ring outlasts 3 ms of
/// a full bus.
#ifndef BRD_FRAME_RING_H
#define BRD_FRAME_RING_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#include <stdatomic.h>

#define BRD_FRAME_RING_LENGTH 64U ///< A power of two.

typedef struct {
    iw_can_frame_t frame[BRD_FRAME_RING_LENGTH];
    uint8_t tag[BRD_FRAME_RING_LENGTH]; ///< The producer's, handed back with the frame.
    atomic_uint head;                   ///< Frames put in since the start. Written by the producer.
    atomic_uint tail;                   ///< Frames taken out since the start. Written by the consumer.
} brd_frame_ring_t;

/// From an interrupt. False if the ring is full: the frame is lost and the caller counts it.
bool brd_frame_ring_put(brd_frame_ring_t *self, const iw_can_frame_t *frame, uint8_t tag);

/// Not from an interrupt. False, outputs untouched, if the ring is empty.
bool brd_frame_ring_take(brd_frame_ring_t *self, iw_can_frame_t *out_frame, uint8_t *out_tag);

#endif
