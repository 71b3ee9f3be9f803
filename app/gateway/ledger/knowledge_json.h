// SPDX-License-Identifier: MIT
/// What is known about the wheels, as JSON.
#ifndef GATEWAY_KNOWLEDGE_JSON_H
#define GATEWAY_KNOWLEDGE_JSON_H

#include "daemon.h"

#include "iwheel_northbound/json_out.h"

/// The objects `ledger` and `memory` of a snapshot: every item; file, state and reason. The ledger's bytes are kept and
/// written again until something of it changes.
void gw_knowledge_write(gw_daemon_t *daemon, const iw_snapshot_t *seen, iwn_out_t *json);

/// One item of the ledger, its state and what it rests on, into an object that is open.
void gw_knowledge_write_item(const gw_daemon_t *daemon, iw_ledger_item_t item, iwn_out_t *json);

#endif
