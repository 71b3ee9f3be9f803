// SPDX-License-Identifier: MIT
// Events: what has changed since the last look, in the daemon's order and words.
#include "host.h"

#include <string.h>

static iwn_out_t begin(iw_host_t *self, const char *name) {
    iwn_out_t json = iw_host_begin_event(self, name);
    iwn_out_int(&json, "t_us", (int64_t)self->now_us);
    return json;
}

static void observe_bus(iw_host_t *self, const iw_snapshot_t *seen, bool first) {
    if (seen->bus != self->told.bus || first) {
        self->told.bus = seen->bus;
        iwn_out_t json = begin(self, "bus");
        iwn_out_text(&json, "state", iwn_bus_state_name(seen->bus));
        iw_host_send_event(self, IWN_TOPIC_BUS, &json);
    }
}

static void observe_estop(iw_host_t *self, bool first) {
    if (self->estop_high != self->told.estop_high || first) {
        self->told.estop_high = self->estop_high;
        iwn_out_t json = begin(self, "estop");
        iwn_out_text(&json, "state", iwn_estop_name(self->estop_high ? 1 : 0, true));
        iw_host_send_event(self, IWN_TOPIC_ESTOP, &json);
    }
}

static void tell_fault(iw_host_t *self, const char *cause, bool present) {
    iwn_out_t json = begin(self, "fault");
    iwn_out_text(&json, "cause", cause);
    iwn_out_bool(&json, "present", present);
    iw_host_send_event(self, IWN_TOPIC_STOP, &json);
}

static void tell_flag(iw_host_t *self, const char *cause, bool present, bool *told) {
    if (present != *told) {
        *told = present;
        tell_fault(self, cause, present);
    }
}

/// While armed or stopping a cause makes a stop, which is told as such; here are the others.
static void observe_faults(iw_host_t *self, const iw_snapshot_t *seen) {
    const uint32_t changed = seen->present ^ self->told.present;
    for (unsigned cause = 0; cause < IW_CAUSES && changed != 0U; cause++) {
        if ((changed & (1U << cause)) != 0U) {
            tell_fault(self, iwn_cause_name((iw_cause_t)cause), (seen->present & (1U << cause)) != 0U);
        }
    }
    self->told.present = seen->present;
    if (seen->still_moving != self->told.still_moving) {
        self->told.still_moving = seen->still_moving;
        tell_fault(self, "still_moving", true);
    }
    tell_flag(self, "zeros_ending", seen->zeros_ending, &self->told.zeros_ending);
    tell_flag(self, "rolling", seen->rolling_fault, &self->told.rolling_fault);
    tell_flag(self, "setpoint_left", seen->left_behind, &self->told.left_behind);
}

static void observe_rolling(iw_host_t *self, const iw_snapshot_t *seen) {
    if (seen->rolling != self->told.rolling) {
        self->told.rolling = seen->rolling;
        iwn_out_t json = begin(self, "rolling");
        iwn_out_bool(&json, "present", seen->rolling);
        iw_host_send_event(self, IWN_TOPIC_STOP, &json);
    }
}

/// Who asked for it or held the lease, while that is still known.
static const char *note_client(iw_host_t *self) {
    iwn_stop_note_t *const note = &self->stop;
    if (note->stop.cause == IW_CAUSE_ESTOP_SOFTWARE) {
        note->stop.client = note->stop.detail;
    }
    const iw_host_client_t *const client = iw_host_find(self, note->stop.client);
    if (client == NULL) {
        return NULL;
    }
    memcpy(note->client_name, client->name, sizeof client->name);
    return iw_host_name(self, client->id, 0);
}

static void observe_stop(iw_host_t *self, const iw_snapshot_t *seen) {
    if (seen->stop->number == self->told.stop_number) {
        return;
    }
    self->told.stop_number = seen->stop->number;
    self->stop.stop = *seen->stop;
    self->stop.wall_us = IWN_WALL_UNKNOWN;
    self->stop.client_name[0] = '\0';
    const iwn_why_context_t context = {
        .client = note_client(self), .reason = self->estop_reason, .estop = self->place.estop, .bus = self->place.bus};
    iwn_why_sentence(&self->stop.stop, &context, self->stop.sentence, sizeof self->stop.sentence);
    iwn_out_t json = begin(self, "stop");
    iwn_tell_stop(&self->stop, self->now_us, &json);
    iw_host_send_event(self, IWN_TOPIC_STOP, &json);
}

static void observe_lease(iw_host_t *self, const iw_snapshot_t *seen) {
    const iw_client_t holder = (seen->state == IW_STATE_ARMED) ? seen->holder : IW_CLIENT_NONE;
    const iw_client_t former = self->told.holder;
    if (holder == former) {
        return;
    }
    const iw_host_client_t *const client = iw_host_find(self, holder);
    self->told.holder = holder;
    iwn_out_t json = begin(self, "lease");
    iwn_tell_lease(&(iwn_holder_t){.client = holder, .name = (client != NULL) ? client->name : NULL}, former, &json);
    iw_host_send_event(self, IWN_TOPIC_LEASE, &json);
}

/// The snapshot itself goes out when the long line is free.
static void observe_state(iw_host_t *self, const iw_snapshot_t *seen, bool first) {
    if (seen->state == self->told.state && !first) {
        return;
    }
    self->told.state = seen->state;
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        iw_host_client_t *const client = &self->client[i];
        client->owed_state = client->owed_state || (client->topics & (1U << IWN_TOPIC_STATE)) != 0U;
    }
}

static void observe_ledger(iw_host_t *self, const iw_snapshot_t *seen) {
    if (seen->assumed_changes == self->told.assumed_changes) {
        return;
    }
    self->told.assumed_changes = seen->assumed_changes;
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; item++) {
        if ((uint8_t)seen->assumed[item].state != self->told.assumed[item]) {
            self->told.assumed[item] = (uint8_t)seen->assumed[item].state;
            iwn_out_t json = begin(self, "ledger");
            iw_host_write_item(self, (iw_ledger_item_t)item, &json);
            iw_host_send_event(self, IWN_TOPIC_STATE, &json);
        }
    }
}

/// Of the zero in force: where it comes from is noted, then told. A tare has been noted with its window.
static void observe_offset(iw_host_t *self, unsigned side, const iw_force_t *force) {
    iw_host_told_t *const told = &self->told;
    const iw_offset_provenance_t former = (iw_offset_provenance_t)told->provenance[side];
    const bool tared = force->provenance == IW_OFFSET_OPERATOR && force->offset_us != told->offset_us[side];
    if (force->provenance == former && force->offset_mN == told->offset_mN[side] && !tared) {
        return;
    }
    if ((force->provenance == IW_OFFSET_ESTIMATED || force->provenance == IW_OFFSET_WHEEL) &&
        force->offset_us != IW_NEVER) {
        static const iw_force_quality_t none = {0};
        self->zero[side] = iw_learnt_zero(force, (force->provenance == IW_OFFSET_ESTIMATED) ? &force->quality : &none);
    }
    iwn_out_t json = begin(self, "offset");
    iwn_out_text(&json, "side", (side == (unsigned)IW_LEFT) ? "left" : "right");
    iwn_out_known(&json, "offset_mN", force->provenance != IW_OFFSET_NONE, force->offset_mN);
    iwn_out_text(&json, "provenance", iwn_offset_word(force->provenance, force->offset_us));
    iwn_out_known(&json, "before_mN", former != IW_OFFSET_NONE, told->offset_mN[side]);
    iwn_out_text(&json, "before_provenance", iwn_offset_word(former, told->offset_us[side]));
    iw_host_send_event(self, IWN_TOPIC_FORCE, &json);
    told->provenance[side] = (uint8_t)force->provenance;
    told->offset_mN[side] = force->offset_mN;
    told->offset_us[side] = force->offset_us;
}

void iw_observe(iw_host_t *self, const iw_snapshot_t *seen) {
    const bool first = !self->told.started;
    self->told.started = true;
    observe_bus(self, seen, first);
    observe_estop(self, first);
    observe_faults(self, seen);
    observe_rolling(self, seen);
    observe_stop(self, seen);
    observe_lease(self, seen);
    observe_state(self, seen, first);
    observe_ledger(self, seen);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        observe_offset(self, side, seen->wheel[side].force);
    }
}
