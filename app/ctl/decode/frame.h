// SPDX-License-Identifier: MIT
/// A frame as one line of text on stdout, and as JSON from the gateway: in the event `frame` and the reply to `why`.
#ifndef FRAME_H
#define FRAME_H

#include "candump.h"
#include "decode_fields.h"

#include <jansson.h>

/// Returns "T" (sent), "R" (received), or "" if the recording has no direction.
const char *frame_direction(const candump_t *frame);

/// Size of the longest line of a frame, with newline and terminator.
#define FRAME_LINE_SIZE 1024U

/// Appends the data in hexadecimal, with `gap` between the bytes.
void frame_add_bytes(const candump_t *frame, const char *gap, iwn_text_t *line);

/// Appends `0x` and the id in hexadecimal: 3 digits, 8 if it is extended.
void frame_add_id(const candump_t *frame, iwn_text_t *line);

/// Prints time (12 columns, any form), id, direction and values; the bytes if the frame has no values.
void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded);

/// Reads a frame that the gateway sent. Its `time_us` is 0; `*out_at_us` is its time on the monotonic clock.
candump_t frame_from_json(const json_t *told, int64_t *out_at_us);

#endif
