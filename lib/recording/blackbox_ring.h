// SPDX-License-Identifier: MIT
/// Ring of the last entries in memory of fixed size that one process writes and another reads. Neither waits for the
/// other: the writer overwrites the oldest entries, and the reader detects entries that were overwritten while it read.
///
/// Entries are packed: a speed frame takes 9 or 12 bytes instead of 32. They are in blocks, and each block can be read
/// without the others.
#ifndef BLACKBOX_RING_H
#define BLACKBOX_RING_H

#include "blackbox_entry.h"

#include <stdatomic.h>

#define BLACKBOX_BLOCK 1024U ///< Size of a block in bytes.
/// Blocks per second: 11 of them hold 617 telemetry frames, 100 setpoints and 50 commands with their steps; the others
/// are for frames of other nodes. On a fuller bus the ring covers a shorter time, and reports it.
#define BLACKBOX_BLOCKS_PER_S 20U
/// Smallest ring.
#define BLACKBOX_BLOCKS_MIN 8U

/// A block of packed entries.
typedef struct {
    uint64_t first;                       ///< Number of its first entry.
    uint64_t at_us;                       ///< Time of that entry. Times in the block are relative to it.
    uint8_t packed[BLACKBOX_BLOCK - 16U]; ///< The entries, one after the other.
} blackbox_block_t;
IW_STATIC_ASSERT(sizeof(blackbox_block_t) == BLACKBOX_BLOCK, blocks_have_no_gaps);

/// The ring, at the beginning of its memory. The memory belongs to the caller and may be shared between processes.
typedef struct {
    atomic_uint_least64_t written; ///< Entries since the start: the number of the next one.
    atomic_uint_least64_t used;    ///< Bytes of blocks since the start, including heads and ends.
    uint64_t blocks;               ///< Number of blocks in the ring.
    uint64_t last_us;              ///< Time of the last entry, for the writer only.
    atomic_bool sending;           ///< Setpoints are sent: if the gateway dies now, that is a stop to record.
    blackbox_block_t block[];      ///< The blocks.
} blackbox_ring_t;

/// Returns the size of the memory in bytes for a ring of this duration.
size_t blackbox_ring_size(uint32_t seconds);

/// Initializes the ring. `memory` has blackbox_ring_size(seconds) bytes, aligned for uint64_t.
void blackbox_ring_init(blackbox_ring_t *self, uint32_t seconds);

/// Adds an entry; overwrites the oldest block if the ring is full. Only one thread of one process may call it. It
/// stores as many data bytes of a frame as the frame's length states, at most 8.
void blackbox_ring_put(blackbox_ring_t *self, const blackbox_entry_t *entry);

/// Returns the number of entries since the start, including those that were overwritten. Any process may call it.
uint64_t blackbox_ring_written(const blackbox_ring_t *self);

/// Returns the largest number of entries that the ring can hold.
size_t blackbox_ring_most(const blackbox_ring_t *self);

/// Returns true while nothing has been overwritten.
bool blackbox_ring_is_whole(const blackbox_ring_t *self);

/// Copies the entries with the numbers from `from` up to but not including `to` (at most those written) to `out`, which
/// has space for them or for blackbox_ring_most. Any process may call it. Returns the number of the first copied entry,
/// which is larger than `from` if older ones were overwritten. `*out_count` is their number.
uint64_t blackbox_ring_copy(const blackbox_ring_t *self, uint64_t from, uint64_t to, blackbox_entry_t *out,
                            size_t *out_count);

#endif
