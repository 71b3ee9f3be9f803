// SPDX-License-Identifier: MIT
/// Everything that is known, as JSON: the body of `status` and of the event `state`, and parts of it for other events.
#ifndef GATEWAY_SNAPSHOT_H
#define GATEWAY_SNAPSHOT_H

#include "ledger/memory.h"
#include "observe.h"

/// Telemetry other than speed is worth nothing after this: five periods of the status and pose frames.
#define GW_STATUS_STALE_US 200000U

/// The fields of a snapshot, into an object that is open.
void gw_snapshot_write(const gw_status_t *status, iwn_out_t *json);

/// Force of both wheels, for the event `force`.
void gw_snapshot_write_force(const gw_status_t *status, iwn_out_t *json);

/// The fields about force of one wheel's object in a snapshot. `known`: its zero, as noted when it was taken.
void gw_snapshot_write_wheel_force(const gw_known_offset_t *known, const iw_snapshot_t *seen, iw_side_t side,
                                   iwn_out_t *json);

/// The age in ms of something that happened then; null if it never did.
void gw_snapshot_write_age(iwn_out_t *json, const char *name, iw_time_us_t now_us, iw_time_us_t then_us);

/// True if it happened, less than `span_us` ago.
bool gw_snapshot_is_fresh(iw_time_us_t now_us, iw_time_us_t then_us, iw_time_us_t span_us);

/// The last stop, for `why` and the event `stop`.
void gw_snapshot_write_stop(const iwn_stop_note_t *note, iw_time_us_t now_us, iwn_out_t *json);

#endif
