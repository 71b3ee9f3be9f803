// SPDX-License-Identifier: MIT
/// A frame as one line for people, on stdout, and as the gateway tells it: the event `frame`, and in the reply to `why`.
#ifndef FRAME_H
#define FRAME_H

#include "candump.h"
#include "decode_fields.h"

#include <jansson.h>

/// "T", "R", or "" if the recording does not tell.
const char *frame_direction(const candump_t *frame);

/// Room for every line of a frame, with its newline and terminator.
#define FRAME_LINE_SIZE 1024U

/// The id in hexadecimal: 3 digits, or 8 of an extended one.
void frame_add_id(const candump_t *frame, iwn_text_t *line);

/// The data in hexadecimal, with `gap` between the bytes.
void frame_add_bytes(const candump_t *frame, const char *gap, iwn_text_t *line);

/// Time (of any form, 12 columns), id, who sent it, and the values; of a frame without any, its bytes.
void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded);

/// The frame that the gateway tells, with `time_us` 0; and when it came, on the monotonic clock.
candump_t frame_from_json(const json_t *told, int64_t *out_at_us);

#endif
