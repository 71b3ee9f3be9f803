// SPDX-License-Identifier: MIT
// Reports changes since the last call to watchers. A state that continues is reported once.
#include "iwheel_server/target.h"

#include <string.h>

static iwn_out_t begin(iwn_server_t *self, const char *name) {
    iwn_out_t json = iwn_server_begin_event(self, name);
    iwn_out_int(&json, "t_us", (int64_t)self->now_us);
    return json;
}

static void observe_bus(iwn_server_t *self, const iw_snapshot_t *seen, bool first) {
    if (seen->bus == self->reported.bus && !first) {
        return;
    }
    const char *const state = iwn_bus_state_name(seen->bus);
    self->reported.bus = seen->bus;
    iwn_target_changed(self, seen, IWN_CHANGE_BUS, state, seen->bus != IW_BUS_ACTIVE);
    iwn_out_t json = begin(self, "bus");
    iwn_out_text(&json, "state", state);
    iwn_server_send_event(self, IWN_TOPIC_BUS, &json);
}

static void observe_estop(iwn_server_t *self, const iw_snapshot_t *seen, bool first) {
    const iwn_estop_t *const estop = &self->estop;
    if (estop->answer == self->reported.estop && estop->pressed_at == self->reported.pressed_at && !first) {
        return;
    }
    const char *const state = iwn_estop_name(estop->answer, estop->present);
    self->reported.estop = estop->answer;
    self->reported.pressed_at = estop->pressed_at;
    iwn_target_changed(self, seen, IWN_CHANGE_ESTOP, state, estop->answer != 0);
    iwn_out_t json = begin(self, "estop");
    iwn_out_text(&json, "state", state);
    if (estop->line2 != NULL) {
        iwn_out_text(&json, "pressed_at", estop->pressed_at);
    }
    iwn_server_send_event(self, IWN_TOPIC_ESTOP, &json);
}

void iwn_server_report_fault(iwn_server_t *self, const char *cause, bool present) {
    iwn_out_t json = begin(self, "fault");
    iwn_out_text(&json, "cause", cause);
    iwn_out_bool(&json, "present", present);
    iwn_server_send_event(self, IWN_TOPIC_STOP, &json);
}

static void report_fault(iwn_server_t *self, const iw_snapshot_t *seen, const char *cause, bool present) {
    iwn_target_changed(self, seen, IWN_CHANGE_FAULT, cause, present);
    iwn_server_report_fault(self, cause, present);
}

/// The first telemetry arrives shortly after the start: until then a wheel without telemetry is not a fault.
static uint32_t faults_of(const iwn_server_t *self, const iw_snapshot_t *seen) {
    const bool early = self->now_us < self->reported.started_us + IWN_FIRST_TELEMETRY_US;
    return early ? seen->present & ~(1U << IW_CAUSE_WHEEL_LOST) : seen->present;
}

/// Omits a fault `rolling` that begins too soon after the last one.
static void observe_rolling_fault(iwn_server_t *self, const iw_snapshot_t *seen) {
    iwn_reported_t *const reported = &self->reported;
    const bool again = reported->rolling_us != 0U && self->now_us - reported->rolling_us < IWN_ROLLING_FAULT_US;
    if (seen->rolling_fault == reported->rolling_fault || (seen->rolling_fault && again)) {
        return;
    }
    reported->rolling_fault = seen->rolling_fault;
    if (seen->rolling_fault) {
        reported->rolling_us = self->now_us;
    }
    iwn_target_changed(self, seen, IWN_CHANGE_ROLLS_AWAY, NULL, seen->rolling_fault);
    report_fault(self, seen, "rolling", seen->rolling_fault);
}

/// While armed or stopping, a cause results in a stop, which is reported as a stop. This function reports the others.
static void observe_faults(iwn_server_t *self, const iw_snapshot_t *seen) {
    iwn_reported_t *const reported = &self->reported;
    const uint32_t present = faults_of(self, seen);
    const uint32_t changed = present ^ reported->present;
    for (unsigned cause = 0; cause < IW_CAUSES && changed != 0U; cause++) {
        if ((changed & (1U << cause)) != 0U) {
            report_fault(self, seen, iwn_cause_name((iw_cause_t)cause), (present & (1U << cause)) != 0U);
        }
    }
    reported->present = present;
    if (seen->still_moving != reported->still_moving) {
        reported->still_moving = seen->still_moving;
        report_fault(self, seen, "still_moving", true);
    }
    if (seen->zeros_ending != reported->zeros_ending) {
        reported->zeros_ending = seen->zeros_ending;
        report_fault(self, seen, "zeros_ending", seen->zeros_ending);
    }
    observe_rolling_fault(self, seen);
    if (seen->left_behind != reported->left_behind) {
        reported->left_behind = seen->left_behind;
        iwn_target_changed(self, seen, IWN_CHANGE_LEFT_BEHIND, NULL, seen->left_behind);
        report_fault(self, seen, "setpoint_left", seen->left_behind);
    }
}

static void observe_rolling(iwn_server_t *self, const iw_snapshot_t *seen) {
    if (seen->rolling == self->reported.rolling) {
        return;
    }
    self->reported.rolling = seen->rolling;
    iwn_target_changed(self, seen, IWN_CHANGE_ROLLING, NULL, seen->rolling);
    iwn_out_t json = begin(self, "rolling");
    iwn_out_bool(&json, "present", seen->rolling);
    iwn_server_send_event(self, IWN_TOPIC_STOP, &json);
}

/// Returns the client that requested the stop or held the lease, while it is known; otherwise NULL.
static const char *note_client(iwn_server_t *self) {
    iwn_stop_note_t *const note = &self->last_stop;
    if (note->stop.cause == IW_CAUSE_ESTOP_SOFTWARE) {
        note->stop.client = note->stop.detail;
    }
    const iwn_client_t *const client = iwn_server_find(self, note->stop.client);
    if (client == NULL) {
        return NULL;
    }
    memcpy(note->client_name, client->name, sizeof client->name);
    return iwn_target_name(self, client->id);
}

static void observe_stop(iwn_server_t *self, const iw_snapshot_t *seen) {
    iwn_stop_note_t *const note = &self->last_stop;
    if (seen->stop->number == self->reported.stop_number) {
        return;
    }
    self->reported.stop_number = seen->stop->number;
    note->stop = *seen->stop;
    note->wall_us = iwn_target_wall_us();
    note->client_name[0] = '\0';
    const iwn_why_context_t context = {
        .client = note_client(self), .reason = self->estop_reason, .estop = self->estop.line, .bus = self->bus};
    iwn_why_sentence(&note->stop, &context, note->sentence, sizeof note->sentence);
    iwn_target_changed(self, seen, IWN_CHANGE_STOP, NULL, true);
    iwn_out_t json = begin(self, "stop");
    iwn_write_stop(note, self->now_us, &json);
    iwn_server_send_event(self, IWN_TOPIC_STOP, &json);
}

static void observe_lease(iwn_server_t *self, const iw_snapshot_t *seen) {
    const iw_client_t holder = (seen->state == IW_STATE_ARMED) ? seen->holder : IW_CLIENT_NONE;
    const iw_client_t former = self->reported.holder;
    if (holder == former) {
        return;
    }
    const iwn_client_t *const client = iwn_server_find(self, holder);
    self->reported.holder = holder;
    iwn_target_changed(self, seen, IWN_CHANGE_LEASE, iwn_write_change(holder, former), holder != IW_CLIENT_NONE);
    iwn_out_t json = begin(self, "lease");
    iwn_write_lease(&(iwn_holder_t){.client = holder, .name = (client != NULL) ? client->name : NULL}, former, &json);
    iwn_server_send_event(self, IWN_TOPIC_LEASE, &json);
}

static void observe_state(iwn_server_t *self, const iw_snapshot_t *seen, bool first) {
    iwn_reported_t *const reported = &self->reported;
    const bool changed = seen->state != reported->state || first;
    if (!changed && seen->holding == reported->holding) {
        return;
    }
    if (first) {
        reported->state = seen->state;
    }
    if (changed) {
        iwn_target_changed(self, seen, IWN_CHANGE_STATE, iwn_state_name(seen->state), true);
    }
    if (seen->holding != reported->holding) {
        iwn_target_changed(self, seen, IWN_CHANGE_HOLDING, NULL, seen->holding);
    }
    reported->state = seen->state;
    reported->holding = seen->holding;
    iwn_target_state(self, seen, false);
}

void iwn_server_observe(iwn_server_t *self, const iw_snapshot_t *seen) {
    const bool first = !self->reported.started;
    if (first) {
        self->reported.started = true;
        self->reported.started_us = self->now_us;
    }
    // What was sent before the last edge of the button is late, as after a client's request to stop.
    const uint32_t edges = seen->present ^ self->reported.present;
    if ((edges & ((1U << IW_CAUSE_ESTOP_LINE) | (1U << IW_CAUSE_ESTOP_DISAGREES))) != 0U) {
        self->stopped_us = self->now_us;
    }
    observe_bus(self, seen, first);
    observe_estop(self, seen, first);
    observe_faults(self, seen);
    observe_rolling(self, seen);
    observe_stop(self, seen);
    observe_lease(self, seen);
    observe_state(self, seen, first);
}
