// SPDX-License-Identifier: MIT
/// A frame as the gateway tells it: the event `frame`, and in the reply to `why`.
#ifndef FRAME_JSON_H
#define FRAME_JSON_H

#include "candump.h"

#include <jansson.h>

/// The frame, with `time_us` 0; and when it came, on the monotonic clock.
candump_t frame_from_json(const json_t *told, int64_t *out_at_us);

#endif
