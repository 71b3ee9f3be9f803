// SPDX-License-Identifier: MIT
/// How regularly setpoint pairs leave: a histogram of the gaps between them, and the worst, since the gateway's start.
///
/// The wheels stop by themselves after 1000 ms without a setpoint, and 100 ms are the most that safety allows. Gaps are
/// counted while pairs are being sent; silence is none.
#ifndef GATEWAY_GAPS_H
#define GATEWAY_GAPS_H

#include "iwheel/snapshot.h"
#include "iwheel_northbound/json_out.h"

#define GW_GAP_BUCKETS 10U

typedef struct {
    uint32_t count[GW_GAP_BUCKETS]; ///< Gaps up to `gw_gap_limits_ms` of the bucket; the last bucket has no limit.
    uint32_t worst_us;
    uint32_t pairs; ///< When last looked at.
} gw_gaps_t;

/// Upper bounds, inclusive, of all buckets but the last.
extern const uint16_t gw_gap_limits_ms[GW_GAP_BUCKETS - 1U];

/// Looks at what was sent after a step, which sends one pair at the most.
void gw_gaps_note(gw_gaps_t *self, const iw_sent_t *sent);

/// Writes the object's fields.
void gw_gaps_write(const gw_gaps_t *self, iwn_out_t *json);

#endif
