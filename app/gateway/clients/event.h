// SPDX-License-Identifier: MIT
/// An event to all who watch its topic.
#ifndef GATEWAY_EVENT_H
#define GATEWAY_EVENT_H

#include "daemon.h"

#include "iwheel_northbound/json_out.h"

/// Begun in the daemon's line buffer, with its name. One at a time.
iwn_out_t gw_event_begin(gw_daemon_t *daemon, const char *name);

/// Closed and sent. Whoever reads too slowly loses it; one that does not fit the buffer is sent to nobody.
void gw_event_send(gw_daemon_t *daemon, iwn_out_t *json, iwn_topic_t topic);

#endif
