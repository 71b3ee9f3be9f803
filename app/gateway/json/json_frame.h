// SPDX-License-Identifier: MIT
/// A frame, for `why` and the event `frame`.
#ifndef GATEWAY_JSON_FRAME_H
#define GATEWAY_JSON_FRAME_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"
#include "iwheel_northbound/json_out.h"

/// Its fields, into an object that is open.
void iwn_out_frame(const iw_can_frame_t *frame, iw_time_us_t at_us, iwn_out_t *json);

#endif
