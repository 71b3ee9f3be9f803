// SPDX-License-Identifier: MIT
// Events about learned facts. The server sends all other events.
#include "host.h"

static iwn_out_t begin(brd_host_t *self, const char *name) {
    iwn_out_t json = iwn_server_begin_event(&self->server, name);
    iwn_out_int(&json, "t_us", (int64_t)self->server.now_us);
    return json;
}

static void observe_assumptions(brd_host_t *self, const iw_snapshot_t *seen) {
    if (seen->assumed_changes == self->reported.assumed_changes) {
        return;
    }
    self->reported.assumed_changes = seen->assumed_changes;
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        if ((uint8_t)seen->assumed[item].state != self->reported.assumed[item]) {
            self->reported.assumed[item] = (uint8_t)seen->assumed[item].state;
            iwn_out_t json = begin(self, "ledger");
            brd_host_write_item(self, (iw_assumption_item_t)item, &json);
            iwn_server_send_event(&self->server, IWN_TOPIC_STATE, &json);
        }
    }
}

/// Stores the source of the offset in force if it has changed, then reports the change. The source of a tare was stored
/// together with its window.
static void observe_offset(brd_host_t *self, unsigned side, const iw_force_t *force) {
    brd_host_reported_t *const reported = &self->reported;
    const iw_offset_provenance_t former = (iw_offset_provenance_t)reported->provenance[side];
    const bool tared = force->provenance == IW_OFFSET_OPERATOR && force->offset_us != reported->offset_us[side];
    if (force->provenance == former && force->offset_mN == reported->offset_mN[side] && !tared) {
        return;
    }
    if ((force->provenance == IW_OFFSET_ESTIMATED || force->provenance == IW_OFFSET_WHEEL) &&
        force->offset_us != IW_NEVER) {
        static const iw_force_quality_t none = {0};
        self->zero[side] =
            brd_assumptions_zero(force, (force->provenance == IW_OFFSET_ESTIMATED) ? &force->quality : &none);
    }
    iwn_out_t json = begin(self, "offset");
    iwn_out_text(&json, "side", (side == (unsigned)IW_LEFT) ? "left" : "right");
    iwn_out_known32(&json, "offset_mN", force->provenance != IW_OFFSET_NONE, force->offset_mN);
    iwn_out_text(&json, "provenance", iwn_offset_word(force->provenance, force->offset_us));
    iwn_out_known32(&json, "before_mN", former != IW_OFFSET_NONE, reported->offset_mN[side]);
    iwn_out_text(&json, "before_provenance", iwn_offset_word(former, reported->offset_us[side]));
    iwn_server_send_event(&self->server, IWN_TOPIC_FORCE, &json);
    reported->provenance[side] = (uint8_t)force->provenance;
    reported->offset_mN[side] = force->offset_mN;
    reported->offset_us[side] = force->offset_us;
}

void brd_host_report_assumptions(brd_host_t *self, const iw_snapshot_t *seen) {
    observe_assumptions(self, seen);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        observe_offset(self, side, seen->wheel[side].force);
    }
}
