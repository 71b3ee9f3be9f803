// SPDX-License-Identifier: MIT
/// The last entries, in memory of fixed size that one process writes and another reads. Neither ever waits for the other:
/// the writer overwrites the oldest, the reader finds out what was overwritten under its hands.
///
/// In the ring entries are packed: a speed frame takes 9 or 12 bytes instead of 32. They lie in blocks, each of which can be read
/// without the others.
#ifndef BLACKBOX_RING_H
#define BLACKBOX_RING_H

#include "blackbox_entry.h"

#include <stdatomic.h>

#define BLACKBOX_BLOCK 1024U
/// Blocks kept per second: 11 of them take 617 telemetry frames, 100 setpoints and 50 commands with their steps, the others are for
/// frames of others. On a fuller bus the ring reaches back for a shorter time, and says so.
#define BLACKBOX_BLOCKS_PER_S 20U
/// A ring is never smaller.
#define BLACKBOX_BLOCKS_MIN 8U

typedef struct {
    uint64_t first; ///< Number of its first entry.
    uint64_t at_us; ///< When that happened: times in the block count from here.
    uint8_t packed[BLACKBOX_BLOCK - 16U];
} blackbox_block_t;
IW_STATIC_ASSERT(sizeof(blackbox_block_t) == BLACKBOX_BLOCK, blocks_have_no_gaps);

typedef struct {
    atomic_uint_least64_t written; ///< Entries since the start: the number of the next one.
    atomic_uint_least64_t used;    ///< Bytes of blocks since the start, heads and ends among them.
    uint64_t blocks;
    uint64_t last_us;    ///< Of the last entry; the writer's.
    atomic_bool sending; ///< Setpoints are being sent: the gateway's death now is a stop worth a recording.
    blackbox_block_t block[];
} blackbox_ring_t;

size_t blackbox_ring_size(uint32_t seconds);

/// `memory` holds blackbox_ring_size(seconds) bytes, aligned for uint64_t.
void blackbox_ring_init(blackbox_ring_t *self, uint32_t seconds);

/// Of a frame's data as many bytes are kept as its length says, at most 8.
void blackbox_ring_put(blackbox_ring_t *self, const blackbox_entry_t *entry);

uint64_t blackbox_ring_written(const blackbox_ring_t *self);

/// So many entries the ring never exceeds.
size_t blackbox_ring_most(const blackbox_ring_t *self);

/// True while nothing has been overwritten.
bool blackbox_ring_is_whole(const blackbox_ring_t *self);

/// Copies the entries with the numbers from `from` up to but not `to` (not beyond what is written) to `out`, which has room for
/// them or for blackbox_ring_most; for any process. Returns the number of the first one copied: larger than `from` if older ones
/// were overwritten. `*out_count`: how many.
uint64_t blackbox_ring_copy(const blackbox_ring_t *self, uint64_t from, uint64_t to, blackbox_entry_t *out,
                            size_t *out_count);

#endif
