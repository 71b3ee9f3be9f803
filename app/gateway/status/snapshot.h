// SPDX-License-Identifier: MIT
/// Everything that is known, as JSON: the body of `status` and of the event `state`, and parts of it for other events.
#ifndef GATEWAY_SNAPSHOT_H
#define GATEWAY_SNAPSHOT_H

#include "daemon.h"

#include "iwheel_northbound/json_out.h"

/// Telemetry other than speed is worth nothing after this: five periods of the status and pose frames.
#define GW_STATUS_STALE_US 200000U

/// The fields of a snapshot, into an object that is open.
void gw_snapshot_write(gw_daemon_t *daemon, iwn_out_t *json);

/// Force of both wheels, for the event `force`.
void gw_snapshot_write_force(const gw_daemon_t *daemon, iwn_out_t *json);

/// The fields about force of one wheel's object in a snapshot.
void gw_snapshot_write_wheel_force(const gw_daemon_t *daemon, const iw_snapshot_t *seen, iw_side_t side,
                                   iwn_out_t *json);

/// The age in ms of something that happened then; null if it never did.
void gw_snapshot_write_age(iwn_out_t *json, const char *name, iw_time_us_t now_us, iw_time_us_t then_us);

/// True if it happened, less than `span_us` ago.
bool gw_snapshot_is_fresh(iw_time_us_t now_us, iw_time_us_t then_us, iw_time_us_t span_us);

/// The last stop, for `why` and the event `stop`.
void gw_snapshot_write_stop(const gw_daemon_t *daemon, iwn_out_t *json);

/// A list of the names of the causes whose bits are set.
void gw_snapshot_write_causes(iwn_out_t *json, const char *name, uint32_t causes);

#endif
