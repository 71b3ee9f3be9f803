// SPDX-License-Identifier: MIT
/// What stands behind the `#` of a line: data, a request for data, or the data of a CAN FD frame. Private.
#ifndef CANDUMP_DATA_H
#define CANDUMP_DATA_H

#include "candump.h"

/// The part of a line that is still to be read.
typedef struct {
    const char *at;
    const char *end;
} candump_cursor_t;

/// 0..15, or -1 if it is no hexadecimal digit.
int candump_hex(char digit);

/// True, and moved on, if the next character is this one.
bool candump_take(candump_cursor_t *cursor, char wanted);

/// Reads from behind the first `#`. NULL, or what is wrong.
const char *candump_parse_data(candump_cursor_t *cursor, candump_t *frame);

#endif
