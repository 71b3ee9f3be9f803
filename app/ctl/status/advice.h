// SPDX-License-Identifier: MIT
/// What to do next, by the state of the gateway, and about a cause.
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

/// Reads the reply of status. At least one line.
void advice_collect(const json_t *status, advice_t *out_advice);

/// What to do about a cause, as the reply of status tells of bus and wheels. False, with nothing in it, if nobody knows.
bool advice_cure(const json_t *status, const char *cause, char out_cure[ADVICE_SIZE]);

/// True if the gateway has seen the cause within the last second, or sees it still.
bool advice_is_present(const json_t *status, const char *cause);

/// True if that item of the ledger, which arm needs, has no value: nobody has configured it.
bool advice_is_unset(const json_t *status, const char *item);

#endif
