// SPDX-License-Identifier: MIT
/// Advice about the next action, from the state of the gateway and from a cause.
#ifndef ADVICE_H
#define ADVICE_H

#include <jansson.h>
#include <stdbool.h>

#define ADVICE_LINES 6U
#define ADVICE_SIZE  320U

typedef struct {
    char line[ADVICE_LINES][ADVICE_SIZE];
    unsigned lines;
} advice_t;

/// Reads the reply of status. Writes at least one line.
void advice_collect(const json_t *status, advice_t *out_advice);

/// Writes the fix for a cause, depending on bus and wheels in the reply of status. Returns false and an empty text for
/// an unknown cause.
bool advice_fix(const json_t *status, const char *cause, char out_fix[ADVICE_SIZE]);

/// Returns true if the gateway has detected the cause within the last second or still detects it.
bool advice_is_present(const json_t *status, const char *cause);

/// Returns true if this item of the assumption store, which arm needs, is not configured and has no value.
bool advice_is_unset(const json_t *status, const char *item);

#endif
