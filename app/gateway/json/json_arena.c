// SPDX-License-Identifier: MIT
#include "json_arena.h"

#include <jansson.h>
#include <stdalign.h>
#include <stdint.h>

static alignas(max_align_t) uint8_t arena[JSON_ARENA_SIZE];
static size_t used;
static size_t peak;

static void *arena_take(size_t size) {
    const size_t step = alignof(max_align_t);
    if (size > sizeof arena) {
        return NULL;
    }
    const size_t rounded = (size + step - 1U) / step * step;
    if (rounded > sizeof arena - used) {
        return NULL;
    }
    void *block = &arena[used];
    used += rounded;
    peak = used > peak ? used : peak;
    return block;
}

static void arena_leave(void *block) {
    (void)block; // All of it goes at once, by json_arena_reset.
}

void json_arena_install(void) {
    json_set_alloc_funcs(arena_take, arena_leave);
    json_object_seed(0);
}

void json_arena_reset(void) {
    used = 0;
}

size_t json_arena_peak(void) {
    return peak;
}
