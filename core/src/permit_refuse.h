// SPDX-License-Identifier: MIT
/// Reasons to refuse arm, drive and reset in the present state of the permission. These functions change nothing.
#ifndef IW_PERMIT_REFUSE_H
#define IW_PERMIT_REFUSE_H

#include "iwheel/private/permit.h"

/// Returns true if the configuration allows sending. Zeros after a restart do not need the track: no stop depends on
/// it.
bool iw_refuse_may_send(const iw_config_t *config);

/// Returns true for causes by which wheels do not follow: the client that drove them is refused for it until the
/// hold ends.
bool iw_refuse_not_followed(iw_cause_t cause);

/// Returns true in the latched phases CUT and LATCHED.
static inline bool iw_refuse_latched(const iw_permit_t *self) {
    return self->phase >= IW_PHASE_CUT;
}

/// Returns the reason why a client that is not the holder cannot be armed now.
iw_refusal_t iw_refuse_arm(const iw_permit_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover);

/// Returns the reason why a well-formed drive command is not accepted now.
iw_refusal_t iw_refuse_drive(const iw_permit_t *self, iw_time_us_t sent_us, iw_client_t client);

/// Returns the reason why the latch remains. Call it only while latched.
iw_refusal_t iw_refuse_reset(const iw_permit_t *self, iw_time_us_t now_us);

#endif
