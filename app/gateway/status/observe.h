// SPDX-License-Identifier: MIT
/// What has changed since the last look, told to the log and to whoever watches; and what is due periodically.
///
/// Everything is told by its edge: a state that lasts is told once.
#ifndef GATEWAY_OBSERVE_H
#define GATEWAY_OBSERVE_H

#include "daemon.h"

#include "iwheel_northbound/json_out.h"

/// Looks at the core and tells what is new. After every step, and before a client's slot is freed.
void gw_observe(gw_daemon_t *daemon);

/// Sends the periodic events that are due.
void gw_observe_periodic(gw_daemon_t *daemon);

/// When `gw_observe_periodic` has something to do; IW_NEVER if nobody watches.
iw_time_us_t gw_observe_next_us(const gw_daemon_t *daemon);

/// Sends the frames that the tape has tapped since the last call to the watchers of the topic `frame`.
void gw_observe_frames(gw_daemon_t *daemon);

/// The event `hello`, to a new client.
void gw_observe_hello(gw_daemon_t *daemon, gw_client_t *client);

/// Name, version and so on, into an object that is open: event and reply of `hello`.
void gw_observe_write_hello(const gw_daemon_t *daemon, const gw_client_t *client, iwn_out_t *json);

#endif
