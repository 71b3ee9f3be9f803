// SPDX-License-Identifier: MIT
/// What to do next, by the state of the gateway.
#ifndef ADVICE_H
#define ADVICE_H

#include <jansson.h>

/// How many lines of advice there may be.
#define ADVICE_LINES 6U
#define ADVICE_SIZE  160U

typedef struct {
    char line[ADVICE_LINES][ADVICE_SIZE];
    unsigned lines;
} advice_t;

/// Reads the reply of status. At least one line.
void advice_collect(const json_t *status, advice_t *out_advice);

#endif
