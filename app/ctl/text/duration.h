// SPDX-License-Identifier: MIT
/// How long, as every verb reads it: `500ms`, `2s`, `1.5s`, `2min`, `1h`. Digits, at most three decimals, and always the unit.
#ifndef DURATION_H
#define DURATION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// How it is written, for help and messages.
#define DURATION_FORM "500ms, 1.5s, 2min or 1h"

/// Of what is told about a wrong one.
#define DURATION_WHY_SIZE 200U

/// From and to what an option may be.
typedef struct {
    int64_t min_us;
    int64_t max_us;
} duration_range_t;

/// False, with `*out_us` untouched, if the text is no duration. Never more than some 114 years.
bool duration_parse(const char *text, int64_t *out_us);

/// The value of `option` (`text` may be null: there is none). False, with `*out_us` untouched and what is wrong and what to
/// write in `out_why`, if it is none or out of range: `2` is refused with `write: --listen 2s`.
bool duration_option(const char *option, const char *text, duration_range_t range, int64_t *out_us,
                     char out_why[DURATION_WHY_SIZE]);

#endif
