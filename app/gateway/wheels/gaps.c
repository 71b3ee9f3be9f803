// SPDX-License-Identifier: MIT
#include "gaps.h"

const uint16_t gw_gap_limits_ms[GW_GAP_BUCKETS - 1U] = {5, 10, 15, 20, 25, 30, 40, 50, 100};

void gw_gaps_note(gw_gaps_t *self, const iw_sent_t *sent) {
    if (sent->pairs == self->pairs) {
        return;
    }
    self->pairs = sent->pairs;
    const uint32_t gap_us = sent->gap_us;
    if (gap_us == 0U) {
        return; // The first pair after silence.
    }
    uint32_t bucket = 0;
    while (bucket < GW_GAP_BUCKETS - 1U && gap_us > gw_gap_limits_ms[bucket] * IW_US_PER_MS) {
        bucket++;
    }
    self->count[bucket]++;
    self->worst_us = (gap_us > self->worst_us) ? gap_us : self->worst_us;
}

void gw_gaps_write(const gw_gaps_t *self, iwn_out_t *json) {
    iwn_out_open(json, "limits_ms", '[');
    for (uint32_t i = 0; i < GW_GAP_BUCKETS - 1U; i++) {
        iwn_out_int(json, NULL, gw_gap_limits_ms[i]);
    }
    iwn_out_close(json, ']');
    iwn_out_open(json, "count", '[');
    for (uint32_t i = 0; i < GW_GAP_BUCKETS; i++) {
        iwn_out_int(json, NULL, self->count[i]);
    }
    iwn_out_close(json, ']');
    iwn_out_known(json, "worst_us", self->worst_us > 0U, self->worst_us);
}
