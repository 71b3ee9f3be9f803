// SPDX-License-Identifier: MIT
/// A frame as one line for people, on stdout.
#ifndef FRAME_LINE_H
#define FRAME_LINE_H

#include "candump.h"
#include "decode_fields.h"

/// "T", "R", or "" if the recording does not tell.
const char *frame_direction(const candump_t *frame);

/// The data in hexadecimal, with `gap` between the bytes.
void frame_print_bytes(const candump_t *frame, const char *gap);

/// Time (of any form, 12 columns), id, who sent it, and the values; of a frame without any, its bytes.
void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded);

#endif
