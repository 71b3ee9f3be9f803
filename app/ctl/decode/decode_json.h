// SPDX-License-Identifier: MIT
/// A frame as one line of JSON, on stdout.
#ifndef DECODE_JSON_H
#define DECODE_JSON_H

#include "candump.h"
#include "decode_fields.h"

/// One object: when and where, id and bytes, whose message it is, and under `values` what it carries, named as in the CSV. What is not
/// known is null. False if there was no memory for it: nothing is written.
bool decode_print_json(const candump_t *frame, const decoded_t *decoded);

#endif
