// SPDX-License-Identifier: MIT
/// A frame as one line of text on stdout, and as the gateway sends it: in the event `frame`, and in the reply to `why`.
#ifndef FRAME_H
#define FRAME_H

#include "candump.h"
#include "decode_fields.h"

#include <jansson.h>

/// Returns "T" (sent), "R" (received), or "" if the recording has no direction.
const char *frame_direction(const candump_t *frame);

/// Prints the data in hexadecimal, with `gap` between the bytes.
void frame_print_bytes(const candump_t *frame, const char *gap);

/// Prints time (12 columns, any form), id, direction and values; the bytes if the frame has no values.
void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded);

/// Reads a frame that the gateway sent. Its `time_us` is 0; `*out_at_us` is its time on the monotonic clock.
candump_t frame_from_json(const json_t *told, int64_t *out_at_us);

#endif
