// SPDX-License-Identifier: MIT
/// Private to the bridge: its gateway's side, for the one that decides. Who calls holds the lock.
#ifndef ROS2_BRIDGE_PARTS_H
#define ROS2_BRIDGE_PARTS_H

#include "common/bridge_service.h"
#include "ros2_bridge.h"

/// For an answer of the gateway's; none in this time, and it hangs.
#define BRIDGE_ASK_MS 150
/// Between the first two tries to find the gateway again; it doubles.
#define BRIDGE_BACKOFF_US 100000

/// Calls the gateway and watches it; if that fails, it is lost.
iwc_result_t bridge_call(bridge_t *self);

/// The connection ends here, and the lease with it; `why` is told in /diagnostics.
void bridge_lose(bridge_t *self, const char *why);

/// Nobody has the wheels by this bridge any more.
void bridge_end_lease(bridge_t *self);

/// Takes what the gateway has said, and publishes what is new of it.
void bridge_listen(bridge_t *self);

/// As `bridge_now_us`, with a sign.
int64_t bridge_monotonic_us(void);

/// Executes a request, or refuses it with the reason, and answers it.
void bridge_take_request(bridge_t *self, const ros_request_t *request);

/// Asks for the lease; `age_us` ago somebody wanted it. Without an answer the gateway is lost.
iwc_result_t bridge_arm(bridge_t *self, int64_t age_us, iwc_terms_t *out_terms);

/// Empty: may drive.
const char *bridge_why_not_drive(const bridge_t *self);

/// By both clocks.
ros_moment_t bridge_moment(void);

#endif
