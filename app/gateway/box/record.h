// SPDX-License-Identifier: MIT
/// A stop on its way into the black box and to disk, and what became of it.
#ifndef GATEWAY_RECORD_H
#define GATEWAY_RECORD_H

#include "daemon.h"

#include "iwheel_northbound/json_out.h"

/// The stop in `daemon->last_stop` has just been seen: notes it, keeps the frames around it and, if it latched, orders a
/// recording.
void gw_record_stop(gw_daemon_t *daemon);

/// Notes the state and what it was before.
void gw_record_state(gw_daemon_t *daemon, iw_state_t before);

/// Notes what the core was told of an assumption: it may refuse to arm for it.
void gw_record_assumption(gw_daemon_t *daemon, iw_ledger_item_t item);

/// Once a second: notes the port's answers, the state and what keeps from arming again.
void gw_record_again(gw_daemon_t *daemon);

/// Takes what the writer tells, to the log.
void gw_record_take(gw_daemon_t *daemon);

/// Where the last stop was written and the frames around it, into an object that is open.
void gw_record_write(const gw_daemon_t *daemon, iwn_out_t *json);

#endif
