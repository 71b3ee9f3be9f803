// SPDX-License-Identifier: MIT
/// The parts of one cycle of the gateway, in the order in which `iw_gateway_step` calls them. Private to the core.
#ifndef IW_STEP_H
#define IW_STEP_H

#include "iwheel/types.h"

struct iw_gateway;

/// Our own lateness, the e-stop line, the state of the bus.
void iw_step_begin(struct iw_gateway *self, iw_time_us_t now_us);

/// Takes what was received: echoes to the TX confirmation, telemetry to the wheels, foreign setpoints to the
/// permission.
void iw_step_receive(struct iw_gateway *self, iw_time_us_t now_us);

/// Silence, reboots, echoes overdue, wheels that do not follow; then the permission's own step.
void iw_step_judge(struct iw_gateway *self, iw_time_us_t now_us);

/// Sends what is due under the permission's demand.
void iw_step_send(struct iw_gateway *self, iw_time_us_t now_us);

/// While nothing is sent, no old setpoint may wait in a controller either: unacknowledged, it is repeated there until a
/// wheel gets power, and then moves it (fault 18). It is purged, or reported as `left_behind`.
void iw_step_keep_silent(struct iw_gateway *self, iw_time_us_t now_us);

/// When to call again: not later than one period from now.
iw_time_us_t iw_step_next_us(const struct iw_gateway *self, iw_time_us_t now_us);

#endif
