// SPDX-License-Identifier: MIT
/// Client of the gateway: arms half a second after both wheels are online and the gateway listens, drives both wheels at
/// 200 mm/s for a second, stops. A program has one.
#ifndef FIRST_DRIVE_H
#define FIRST_DRIVE_H

#include "iwheel/gateway.h"

/// Configures and starts the gateway. `restarted`: the run before this one ended while it was sending. Returns false if
/// the configuration is not valid; then do not continue.
bool first_drive_init(iw_gateway_t *gateway, const iw_hal_t *hal, iw_time_us_t now_us, bool restarted);

/// Arms, drives or stops, depending on the time. Call it before each step. Returns why the core refused it, or why it
/// waits; see `iw_refusal_text`.
iw_refusal_t first_drive_command(iw_gateway_t *gateway, iw_time_us_t now_us);

#endif
