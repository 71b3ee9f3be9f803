// SPDX-License-Identifier: MIT
#include "blackbox_ring.h"

#include <string.h>

/// Form of an entry: tag, a, b; time since the begin of the block, unless it is that of the entry before; number; the
/// contents of `as`. The tag is the kind and these bits.
#define KIND      0x1FU
#define SAME_TIME 0x20U
#define LONG      0x40U ///< The number has four bytes, not two.
#define FILLED    0x80U ///< All of `as` follows. Without this bit, a frame is followed by as many bytes as it has.
/// Tag that marks the rest of the block as empty.
#define END KIND
IW_STATIC_ASSERT(BLACKBOX_KINDS <= END, end_is_no_kind);

#define OFFSET_MAX 0xFFFFFFU ///< The time has three bytes.
#define PACKED_MIN 5U
#define PACKED_MAX (PACKED_MIN + 3U + 2U + sizeof(((blackbox_entry_t *)0)->as))

size_t blackbox_ring_size(uint32_t seconds) {
    const size_t wanted = (size_t)seconds * BLACKBOX_BLOCKS_PER_S;
    return sizeof(blackbox_ring_t) +
           ((wanted > BLACKBOX_BLOCKS_MIN) ? wanted : BLACKBOX_BLOCKS_MIN) * sizeof(blackbox_block_t);
}

void blackbox_ring_init(blackbox_ring_t *self, uint32_t seconds) {
    atomic_init(&self->written, 0);
    atomic_init(&self->used, 0);
    atomic_init(&self->sending, false);
    self->blocks = (blackbox_ring_size(seconds) - sizeof *self) / sizeof(blackbox_block_t);
    self->last_us = 0;
}

/// Returns the number of bytes of `as` that follow.
static size_t filling(const blackbox_entry_t *entry, uint8_t tag) {
    if (entry->kind == (uint8_t)BLACKBOX_FRAME) {
        return (entry->a < sizeof entry->as.data) ? entry->a : sizeof entry->as.data;
    }
    return ((tag & FILLED) != 0U) ? sizeof entry->as : 0U;
}

static bool is_filled(const blackbox_entry_t *entry) {
    uint32_t words[sizeof entry->as / sizeof(uint32_t)];
    uint32_t any = 0;
    if (entry->kind == (uint8_t)BLACKBOX_FRAME) {
        return false;
    }
    memcpy(words, &entry->as, sizeof words);
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        any |= words[i];
    }
    return any != 0U;
}

/// Writes four bytes, of which the first `size` count: compilers make one store of them.
static size_t put_number(uint8_t *to, uint32_t number, size_t size) {
    to[0] = (uint8_t)number;
    to[1] = (uint8_t)(number >> 8);
    to[2] = (uint8_t)(number >> 16);
    to[3] = (uint8_t)(number >> 24);
    return size;
}

static uint32_t take_number(const uint8_t *from, size_t size) {
    uint32_t number = 0;
    for (size_t i = 0; i < size; i++) {
        number |= (uint32_t)from[i] << (8U * i);
    }
    return number;
}

/// Returns the number of bytes that count. The bytes after them, up to PACKED_MAX, are overwritten by the next entry or
/// never read.
static size_t pack(const blackbox_entry_t *entry, bool same_time, uint32_t offset_us, uint8_t *to) {
    const bool is_long = entry->number > UINT16_MAX;
    size_t at = 3;
    to[0] = (uint8_t)(entry->kind | (same_time ? SAME_TIME : 0U) | (is_long ? LONG : 0U) |
                      (is_filled(entry) ? FILLED : 0U));
    to[1] = entry->a;
    to[2] = entry->b;
    at += same_time ? 0U : put_number(&to[at], offset_us, 3);
    at += put_number(&to[at], entry->number, is_long ? 4U : 2U);
    memcpy(&to[at], &entry->as, sizeof entry->as);
    return at + filling(entry, to[0]);
}

/// Returns the number of bytes read. `*out` is the entry before.
static size_t unpack(const uint8_t *from, uint64_t begin_us, blackbox_entry_t *out) {
    const uint8_t tag = from[0];
    const uint64_t before_us = out->at_us;
    const size_t number_size = ((tag & LONG) != 0U) ? 4U : 2U;
    size_t at = 3;
    *out = (blackbox_entry_t){.at_us = before_us, .kind = tag & KIND, .a = from[1], .b = from[2]};
    if ((tag & SAME_TIME) == 0U) {
        out->at_us = begin_us + take_number(&from[at], 3);
        at += 3U;
    }
    out->number = take_number(&from[at], number_size);
    at += number_size;
    memcpy(&out->as, &from[at], filling(out, tag));
    return at + filling(out, tag);
}

/// Ends the block and begins the next one. Returns the bytes used with it.
static uint64_t begin_block(blackbox_ring_t *self, uint64_t used, uint64_t number, uint64_t at_us) {
    const uint64_t index = (used + BLACKBOX_BLOCK - 1U) / BLACKBOX_BLOCK;
    blackbox_block_t *block = &self->block[index % self->blocks];
    if (used % BLACKBOX_BLOCK != 0U) {
        uint8_t *old = (uint8_t *)&self->block[(index - 1U) % self->blocks];
        old[used % BLACKBOX_BLOCK] = END;
    }
    block->first = number;
    block->at_us = at_us;
    self->last_us = at_us;
    return index * BLACKBOX_BLOCK + offsetof(blackbox_block_t, packed);
}

void blackbox_ring_put(blackbox_ring_t *self, const blackbox_entry_t *entry) {
    const uint64_t number = atomic_load_explicit(&self->written, memory_order_relaxed);
    uint64_t used = atomic_load_explicit(&self->used, memory_order_relaxed);
    const size_t space = BLACKBOX_BLOCK - used % BLACKBOX_BLOCK;
    const uint64_t begun_us = self->block[used / BLACKBOX_BLOCK % self->blocks].at_us;
    // One byte more, for the end.
    if (number == 0U || space <= PACKED_MAX || entry->at_us - begun_us > OFFSET_MAX) {
        used = begin_block(self, used, number, entry->at_us);
    }
    blackbox_block_t *block = &self->block[used / BLACKBOX_BLOCK % self->blocks];
    uint8_t *to = (uint8_t *)block + used % BLACKBOX_BLOCK;
    used += pack(entry, entry->at_us == self->last_us, (uint32_t)(entry->at_us - block->at_us), to);
    self->last_us = entry->at_us;
    atomic_store_explicit(&self->used, used, memory_order_release);
    atomic_store_explicit(&self->written, number + 1U, memory_order_release);
}

uint64_t blackbox_ring_written(const blackbox_ring_t *self) {
    return atomic_load_explicit(&self->written, memory_order_acquire);
}

size_t blackbox_ring_most(const blackbox_ring_t *self) {
    return (size_t)self->blocks * sizeof self->block[0].packed / PACKED_MIN;
}

/// Returns the index of the oldest block that is certainly complete: the writer may already write the next one.
static uint64_t oldest(const blackbox_ring_t *self) {
    const uint64_t next = atomic_load_explicit(&self->used, memory_order_acquire) / BLACKBOX_BLOCK + 1U;
    return (next >= self->blocks) ? next - self->blocks + 1U : 0U;
}

bool blackbox_ring_is_whole(const blackbox_ring_t *self) {
    return oldest(self) == 0U;
}

/// Returns the index of the block with this entry, or of the oldest block if that is overwritten.
static uint64_t find(const blackbox_ring_t *self, uint64_t used, uint64_t number) {
    const uint64_t least = oldest(self);
    uint64_t index = used / BLACKBOX_BLOCK;
    while (index > least && self->block[index % self->blocks].first > number) {
        index--;
    }
    return index;
}

/// Unpacks the entries from..to of the first `size` bytes of a block. Returns their number.
static size_t take_block(const blackbox_block_t *block, size_t size, uint64_t from, uint64_t to,
                         blackbox_entry_t *out) {
    const uint8_t *bytes = (const uint8_t *)block;
    blackbox_entry_t entry = {.at_us = block->at_us};
    uint64_t number = block->first;
    size_t count = 0;
    for (size_t at = offsetof(blackbox_block_t, packed); at < size && bytes[at] != END && number < to; number++) {
        at += unpack(&bytes[at], block->at_us, &entry);
        if (number >= from) {
            out[count++] = entry;
        }
    }
    return count;
}

uint64_t blackbox_ring_copy(const blackbox_ring_t *self, uint64_t from, uint64_t to, blackbox_entry_t *out,
                            size_t *out_count) {
    const uint64_t used = atomic_load_explicit(&self->used, memory_order_acquire);
    uint64_t first = from;
    bool begun = false;
    size_t count = 0;
    for (uint64_t index = find(self, used, from); index * BLACKBOX_BLOCK < used; index++) {
        const blackbox_block_t block = self->block[index % self->blocks];
        const uint64_t left = used - index * BLACKBOX_BLOCK;
        atomic_thread_fence(memory_order_acquire);
        if (index <
            oldest(self)) { // The block was overwritten in the meantime and may be torn: copying starts after it.
            begun = false;
            count = 0;
            continue;
        }
        if (!begun && block.first > from) {
            first = block.first;
        }
        begun = true;
        count += take_block(&block, (left < BLACKBOX_BLOCK) ? (size_t)left : BLACKBOX_BLOCK, from, to, &out[count]);
    }
    *out_count = count;
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
    [BLACKBOX_RELEASE] = "release",
    [BLACKBOX_GONE] = "gone",
    [BLACKBOX_TARE] = "tare",
    [BLACKBOX_ASSUMPTION] = "ledger",
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
