// SPDX-License-Identifier: MIT
/// The memory in which jansson parses a request: one fixed arena, emptied before each.
///
/// jansson knows one pair of allocation functions for the whole process, without a context, so the arena is the one
/// piece of file-scope state of the gateway. When it is full, parsing fails and the request is refused.
#ifndef GATEWAY_JSON_ARENA_H
#define GATEWAY_JSON_ARENA_H

#include <stddef.h>

/// Enough for the worst line of 4096 bytes, with room to spare.
#define JSON_ARENA_SIZE 524288U

/// Once at start, before any use of jansson.
void json_arena_install(void);

/// Forgets everything that was parsed. No jansson value may be used afterwards.
void json_arena_reset(void);

/// The most that was ever in use, in bytes.
size_t json_arena_peak(void);

#endif
