// SPDX-License-Identifier: MIT
/// A refusal of the core in words: cause and cure, with the numbers of this moment.
#ifndef GATEWAY_REFUSE_H
#define GATEWAY_REFUSE_H

#include "daemon.h"

/// `request` is the one refused.
void gw_refuse_describe(gw_daemon_t *daemon, const iwn_request_t *request, iw_refusal_t refusal,
                        iwn_refusal_t *out_refusal);

/// The same for what a contradicted item of the ledger keeps from being done.
void gw_refuse_describe_contradicted(const gw_daemon_t *daemon, iw_ledger_item_t item, iwn_refusal_t *out_refusal);

/// The same for a tare of that wheel.
void gw_refuse_describe_tare(iw_side_t side, iw_tare_t result, iwn_refusal_t *out_refusal);

#endif
