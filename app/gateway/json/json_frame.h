// SPDX-License-Identifier: MIT
/// A frame, for `why` and the event `frame`.
#ifndef GATEWAY_JSON_FRAME_H
#define GATEWAY_JSON_FRAME_H

#include "json_out.h"

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

/// Its fields, into an object that is open.
void json_frame_write(const iw_can_frame_t *frame, iw_time_us_t at_us, json_out_t *json);

#endif
