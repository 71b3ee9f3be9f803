// SPDX-License-Identifier: MIT
/// The answer of `status`, drawn for a human: at most 80 columns, every number with its unit, `--` for what is unknown.
#ifndef SCREEN_H
#define SCREEN_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/// Draws `status` (the reply of status). `why` is the reply of why, or null. A field that is missing or of another type counts as
/// unknown, so an older or newer gateway does no harm.
void screen_status(const json_t *status, const json_t *why, bool colour, FILE *out);

#endif
