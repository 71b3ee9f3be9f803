// SPDX-License-Identifier: MIT
/// The last entries, in memory of fixed size that one process writes and another reads. Neither ever waits for the other:
/// the writer overwrites the oldest, the reader finds out what was overwritten under its hands.
#ifndef BLACKBOX_RING_H
#define BLACKBOX_RING_H

#include "blackbox_entry.h"

#include <stdatomic.h>

/// Entries kept per second: 617 telemetry frames, 100 setpoints at 50 Hz, and as much again for requests, steps and frames of others.
/// On a fuller bus the ring reaches back for a shorter time, and says so.
#define BLACKBOX_ENTRIES_PER_S 2000U
/// A ring is never smaller.
#define BLACKBOX_ENTRIES_MIN 512U

typedef struct {
    atomic_uint_least64_t written; ///< Entries since the start. Entry number n is in slot n % capacity.
    uint64_t capacity;
    atomic_bool sending; ///< Setpoints are being sent: the gateway's death now is a stop worth a recording.
    blackbox_entry_t entry[];
} blackbox_ring_t;

/// Bytes for a ring of that many seconds.
size_t blackbox_ring_size(uint32_t seconds);

/// `memory` holds blackbox_ring_size(seconds) bytes, aligned for uint64_t.
void blackbox_ring_init(blackbox_ring_t *self, uint32_t seconds);

void blackbox_ring_put(blackbox_ring_t *self, const blackbox_entry_t *entry);

uint64_t blackbox_ring_written(const blackbox_ring_t *self);

/// Copies the entries with the numbers from `from` up to but not `to` (not beyond what is written) to `out`; for any process.
/// Returns the number of the first one copied: larger than `from` if older ones were overwritten. `*out_count`: how many.
uint64_t blackbox_ring_copy(const blackbox_ring_t *self, uint64_t from, uint64_t to, blackbox_entry_t *out,
                            size_t *out_count);

#endif
