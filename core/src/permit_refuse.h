// SPDX-License-Identifier: MIT
/// Why a request is refused: every reason against arm, drive and reset, judged by the permission as it is. Nothing is
/// changed here.
#ifndef IW_PERMIT_REFUSE_H
#define IW_PERMIT_REFUSE_H

#include "iwheel/private/permit.h"

/// True if the configuration allows sending at all. Zeros of a restart need no track: no stop depends on it.
bool iw_refuse_may_send(const iw_config_t *config);

/// The wheels did not follow: whoever drove is refused for that until the hold ends.
bool iw_refuse_not_followed(iw_cause_t cause);

/// The last phases: CUT and LATCHED.
bool iw_refuse_latched(const iw_permit_t *self);

/// Why a client that is not the holder is not armed now.
iw_refusal_t iw_refuse_arm(const iw_permit_t *self, iw_time_us_t now_us, bool takeover);

/// Why a well-formed drive command is not accepted now.
iw_refusal_t iw_refuse_drive(const iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client);

/// Why the latch stays. Only while latched.
iw_refusal_t iw_refuse_reset(const iw_permit_t *self, iw_time_us_t now_us);

#endif
