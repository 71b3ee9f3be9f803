// SPDX-License-Identifier: MIT
/// Everything that is known, as JSON: the body of `status` and of the event `state`, and parts of it for other events.
#ifndef GATEWAY_SNAPSHOT_H
#define GATEWAY_SNAPSHOT_H

#include "observe.h"

#include "iwheel_northbound/tell.h"

/// What surrounds the core, for the library that writes it. It points into `status` and `seen`.
iwn_surroundings_t gw_snapshot_around(const gw_status_t *status, const iw_snapshot_t *seen);

/// The fields of a snapshot, into an object that is open.
void gw_snapshot_write(const gw_status_t *status, iwn_out_t *json);

/// Force of both wheels, for the event `force`.
void gw_snapshot_write_force(const gw_status_t *status, iwn_out_t *json);

#endif
