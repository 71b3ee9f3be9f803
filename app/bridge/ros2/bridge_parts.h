// SPDX-License-Identifier: MIT
/// Private to the bridge: the interface between its files. The caller of each function holds the lock of the bridge.
#ifndef ROS2_BRIDGE_PARTS_H
#define ROS2_BRIDGE_PARTS_H

#include "common/bridge_service.h"
#include "ros2_bridge.h"

/// Longest wait for a reply of the gateway. A gateway that takes longer counts as hung.
#define BRIDGE_ASK_MS 150
/// Interval between the first two attempts to connect again; it doubles with each attempt.
#define BRIDGE_BACKOFF_US 100000

/// Connects to the gateway and subscribes to its events. On failure it ends the connection by `bridge_lose`.
iwc_result_t bridge_call(bridge_t *self);

/// Ends the connection, and with it the lease. /diagnostics reports `why`.
void bridge_lose(bridge_t *self, const char *why);

/// Records that this bridge has no lease and no driver any more. Sends nothing.
void bridge_end_lease(bridge_t *self);

/// Reads all messages of the gateway that are waiting, and publishes motion and wrench if there was a new snapshot and a
/// node uses the bridge.
void bridge_listen(bridge_t *self);

/// Requests the rate of [odometry] while a node uses the bridge or the bridge holds the lease, and otherwise the least
/// rate. Does not wait for the reply.
void bridge_choose_rate(bridge_t *self, int64_t now);

/// Returns `bridge_now_us` as a signed number.
int64_t bridge_monotonic_us(void);

/// Executes a request, or refuses it with the reason. Sends the reply in both cases.
void bridge_take_request(bridge_t *self, const ros_request_t *request);

/// Requests the lease; the person asked for it `age_us` ago. If the gateway does not reply, ends the connection.
iwc_result_t bridge_arm(bridge_t *self, int64_t age_us, iwc_terms_t *out_terms);

/// Returns why this bridge cannot drive, with the fix; empty: it can.
const char *bridge_why_not_drive(const bridge_t *self);

/// Returns the present time on both clocks.
ros_moment_t bridge_moment(void);

#endif
