// SPDX-License-Identifier: MIT
/// A refusal of the core in words: cause and cure, with the numbers of this moment.
#ifndef GATEWAY_REFUSE_H
#define GATEWAY_REFUSE_H

#include "clients/client.h"
#include "dispatch.h"

/// `request` is the one refused.
void gw_refuse_describe(const gw_answers_t *answers, const iwn_request_t *request, iw_refusal_t refusal,
                        iwn_refusal_t *out_refusal);

/// True, with which right it needs and how to have it in `out_refusal`, if a client with that right may not ask for it. Who may only
/// watch may ask for what moves nothing and for what stops.
bool gw_refuse_by_right(const gw_answers_t *answers, gw_right_t right, iwn_cmd_t cmd, iwn_refusal_t *out_refusal);

/// The same for a tare of that wheel.
void gw_refuse_describe_tare(iw_side_t side, iw_tare_t result, iwn_refusal_t *out_refusal);

#endif
