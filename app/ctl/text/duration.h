// SPDX-License-Identifier: MIT
/// A duration as each verb reads it: `500ms`, `2s`, `1.5s`, `2min`, `1h`. Digits, at most three decimals, and always
/// the unit.
#ifndef DURATION_H
#define DURATION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Form for help and messages.
#define DURATION_FORM "500ms, 1.5s, 2min or 1h"

/// Size of the text about a wrong duration.
#define DURATION_WHY_SIZE 200U

/// Bounds of an option; both belong to the range.
typedef struct {
    int64_t min_us;
    int64_t max_us;
} duration_range_t;

/// Reads a duration. Returns false and leaves `*out_us` unchanged if the text is not one. The maximum is about 114
/// years.
bool duration_parse(const char *text, int64_t *out_us);

/// Reads the value of `option`; `text` may be NULL (no value). If it is not valid or out of range, returns false,
/// leaves `*out_us` unchanged, and writes the mistake and its fix to `out_why`: `2` is refused with `write: --listen
/// 2s`.
bool duration_option(const char *option, const char *text, duration_range_t range, int64_t *out_us,
                     char out_why[DURATION_WHY_SIZE]);

#endif
