// SPDX-License-Identifier: MIT
#include "blackbox_ring.h"

#include <string.h>

static uint64_t capacity_of(uint32_t seconds) {
    const uint64_t wanted = (uint64_t)seconds * BLACKBOX_ENTRIES_PER_S;
    return (wanted > BLACKBOX_ENTRIES_MIN) ? wanted : BLACKBOX_ENTRIES_MIN;
}

size_t blackbox_ring_size(uint32_t seconds) {
    return sizeof(blackbox_ring_t) + (size_t)capacity_of(seconds) * sizeof(blackbox_entry_t);
}

void blackbox_ring_init(blackbox_ring_t *self, uint32_t seconds) {
    atomic_init(&self->written, 0);
    atomic_init(&self->sending, false);
    self->capacity = capacity_of(seconds);
}

void blackbox_ring_put(blackbox_ring_t *self, const blackbox_entry_t *entry) {
    const uint64_t number = atomic_load_explicit(&self->written, memory_order_relaxed);
    self->entry[number % self->capacity] = *entry;
    atomic_store_explicit(&self->written, number + 1U, memory_order_release);
}

uint64_t blackbox_ring_written(const blackbox_ring_t *self) {
    return atomic_load_explicit(&self->written, memory_order_acquire);
}

/// The oldest entry that is surely whole: the slot of the one before it may be under the writer's hands.
static uint64_t oldest(const blackbox_ring_t *self) {
    const uint64_t written = blackbox_ring_written(self);
    return (written >= self->capacity) ? written - self->capacity + 1U : 0U;
}

uint64_t blackbox_ring_copy(const blackbox_ring_t *self, uint64_t from, uint64_t to, blackbox_entry_t *out,
                            size_t *out_count) {
    const uint64_t written = blackbox_ring_written(self);
    const uint64_t end = (to < written) ? to : written;
    uint64_t first = (from > oldest(self)) ? from : oldest(self);
    for (uint64_t number = first; number < end; number++) {
        out[number - first] = self->entry[number % self->capacity];
    }
    atomic_thread_fence(memory_order_acquire);
    const uint64_t valid = oldest(self); // What was overwritten meanwhile may be torn.
    const size_t copied = (first < end) ? (size_t)(end - first) : 0U;
    const size_t torn = (valid <= first) ? 0U : (valid - first < copied) ? (size_t)(valid - first) : copied;
    memmove(out, out + torn, (copied - torn) * sizeof *out);
    first += torn;
    *out_count = copied - torn;
    return first;
}

static const char *const names[BLACKBOX_KINDS] = {
    [BLACKBOX_FRAME] = "frame",
    [BLACKBOX_STEP] = "step",
    [BLACKBOX_START] = "start",
    [BLACKBOX_ESTOP] = "estop_line",
    [BLACKBOX_BUS] = "bus",
    [BLACKBOX_FACTS] = "facts",
    [BLACKBOX_SUSPENDED] = "suspended",
    [BLACKBOX_NOT_SENT] = "not_sent",
    [BLACKBOX_PURGE] = "purge",
    [BLACKBOX_ARM] = "arm",
    [BLACKBOX_DRIVE] = "drive",
    [BLACKBOX_STOP] = "stop",
    [BLACKBOX_ESTOPPED] = "estop",
    [BLACKBOX_RESET] = "reset",
    [BLACKBOX_GONE] = "gone",
    [BLACKBOX_TARE] = "tare",
    [BLACKBOX_LEDGER] = "ledger",
    [BLACKBOX_STATE] = "state",
    [BLACKBOX_STOPPED] = "stopped",
};

const char *blackbox_kind_name(blackbox_kind_t kind) {
    return ((unsigned)kind < BLACKBOX_KINDS) ? names[kind] : "unknown";
}

blackbox_kind_t blackbox_kind_of(const char *name) {
    for (unsigned kind = 0; kind < BLACKBOX_KINDS; kind++) {
        if (strcmp(names[kind], name) == 0) {
            return (blackbox_kind_t)kind;
        }
    }
    return BLACKBOX_KINDS;
}
