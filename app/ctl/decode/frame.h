// SPDX-License-Identifier: MIT
/// A frame as one line for people, on stdout, and as the gateway tells it: the event `frame`, and in the reply to `why`.
#ifndef FRAME_H
#define FRAME_H

#include "candump.h"
#include "decode_fields.h"

#include <jansson.h>

/// "T", "R", or "" if the recording does not tell.
const char *frame_direction(const candump_t *frame);

/// The data in hexadecimal, with `gap` between the bytes.
void frame_print_bytes(const candump_t *frame, const char *gap);

/// Time (of any form, 12 columns), id, who sent it, and the values; of a frame without any, its bytes.
void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded);

/// The frame that the gateway tells, with `time_us` 0; and when it came, on the monotonic clock.
candump_t frame_from_json(const json_t *told, int64_t *out_at_us);

#endif
