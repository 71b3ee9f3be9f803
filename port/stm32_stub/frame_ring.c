// SPDX-License-Identifier: MIT
#include "frame_ring.h"

#include <assert.h>

static_assert((BRD_FRAME_RING_LENGTH & (BRD_FRAME_RING_LENGTH - 1U)) == 0U, "the indices wrap at a power of two");

/// Releases the index after the frame is written and acquires it before the frame is read, so that the other side never
/// sees an index without its frame.
bool brd_frame_ring_put(brd_frame_ring_t *self, const iw_can_frame_t *frame, uint8_t tag) {
    const unsigned head = atomic_load_explicit(&self->head, memory_order_relaxed);
    const unsigned tail = atomic_load_explicit(&self->tail, memory_order_acquire);
    if (head - tail >= BRD_FRAME_RING_LENGTH) {
        return false;
    }
    self->frame[head % BRD_FRAME_RING_LENGTH] = *frame;
    self->tag[head % BRD_FRAME_RING_LENGTH] = tag;
    atomic_store_explicit(&self->head, head + 1U, memory_order_release);
    return true;
}

bool brd_frame_ring_take(brd_frame_ring_t *self, iw_can_frame_t *out_frame, uint8_t *out_tag) {
    const unsigned tail = atomic_load_explicit(&self->tail, memory_order_relaxed);
    const unsigned head = atomic_load_explicit(&self->head, memory_order_acquire);
    if (head == tail) {
        return false;
    }
    *out_frame = self->frame[tail % BRD_FRAME_RING_LENGTH];
    *out_tag = self->tag[tail % BRD_FRAME_RING_LENGTH];
    atomic_store_explicit(&self->tail, tail + 1U, memory_order_release);
    return true;
}
