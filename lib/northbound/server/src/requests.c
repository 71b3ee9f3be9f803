// SPDX-License-Identifier: MIT
// Execution of each request.
#include "server_calls.h"

#include <string.h>

void iwn_server_begin(iwn_server_t *self) {
    iwn_stop_note_t *const note = &self->last_stop;
    iwn_why_sentence(&note->stop, &(iwn_why_context_t){0}, note->sentence, sizeof note->sentence);
}

void iwn_server_refuse_as(iwn_server_t *self, iwn_client_t *client, iw_refusal_t refusal) {
    iwn_refuse_context_t context = {
        .seen = iwn_server_snapshot(self),
        .last_stop = self->last_stop.sentence,
        .estopped_us = self->estopped_us,
        .estop = self->estop.line,
        .estop_answer = self->estop.answer,
        .bus = self->bus,
    };
    iwn_target_describe(self, refusal, &context);
    iwn_refuse_describe(&context, &self->request, refusal, &self->refusal);
    iwn_server_refuse(self, client, &self->request.id);
}

/// Answers a stop whose line is refused with that refusal.
static void reply_state(iwn_server_t *self, iwn_client_t *client) {
    if (self->request.refused != IWN_OK) {
        iwn_server_refuse(self, client, &self->request.id);
        return;
    }
    iwn_out_t json = iwn_server_begin_reply(self, &self->request.id);
    iwn_out_text(&json, "state", iwn_state_name(iw_gateway_state(self->core)));
    iwn_server_send_reply(self, client, &json);
}

static void do_hello(iwn_server_t *self, iwn_client_t *client) {
    iwn_out_t json = iwn_server_begin_reply(self, &self->request.id);
    iwn_server_write_hello(self, client, &json);
    iwn_server_send_reply(self, client, &json);
}

static void do_watch(iwn_server_t *self, iwn_client_t *client) {
    const iwn_request_t *const request = &self->request;
    const bool limited = request->rate_hz > (int64_t)self->rate_max_hz;
    client->topics = request->topics & self->topics;
    client->rate_hz = limited ? self->rate_max_hz : (uint32_t)request->rate_hz;
    client->next_us = self->now_us;
    iwn_out_t json = iwn_server_begin_reply(self, &request->id);
    iwn_write_watched(client->topics, client->rate_hz, limited || client->topics != request->topics, &json);
    iwn_server_send_reply(self, client, &json);
}

static void do_arm(iwn_server_t *self, iwn_client_t *client) {
    if (!iwn_target_permits(self, client)) {
        iwn_server_refuse(self, client, &self->request.id);
        return;
    }
    const iw_refusal_t refusal = iw_gateway_arm(self->core, self->now_us, client->id, self->request.takeover);
    iwn_target_judged(self, client, refusal);
    if (refusal != IW_REFUSE_NONE) {
        iwn_server_refuse_as(self, client, refusal);
        return;
    }
    if (self->request.name[0] != '\0') {
        memcpy(client->name, self->request.name, sizeof client->name);
    }
    client->arming = true;
    iwn_target_granted(self, client);
}

static void reply_armed(iwn_server_t *self, iwn_client_t *client, const iw_snapshot_t *seen, const iwn_id_t *id) {
    const iwn_surroundings_t around = iwn_target_around(self, seen);
    iwn_out_t json = iwn_server_begin_reply(self, id);
    iwn_write_terms(seen, &around, &json);
    iwn_target_write_terms(self, client, &json);
    iwn_server_send_reply(self, client, &json);
}

static void settle(iwn_server_t *self, iwn_client_t *client, const iw_snapshot_t *seen) {
    const iwn_id_t *const id = iwn_target_settled(self, client);
    client->arming = false;
    if (seen->holder == client->id && seen->state == IW_STATE_ARMED) {
        reply_armed(self, client, seen, id);
        return;
    }
    memset(&self->request, 0, sizeof self->request);
    self->request.cmd = IWN_CMD_ARM;
    self->request.id = *id;
    iwn_server_refuse_as(self, client, (seen->arm_refusal == IW_REFUSE_NONE) ? IW_REFUSE_NOT_ARMED : seen->arm_refusal);
}

void iwn_server_arming(iwn_server_t *self, const iw_snapshot_t *seen) {
    for (iwn_client_t *client = iwn_target_next(self, NULL); client != NULL; client = iwn_target_next(self, client)) {
        if (client->arming && !(seen->arming && seen->holder == client->id)) {
            settle(self, client, seen);
        }
    }
}

static void do_stop(iwn_server_t *self, iwn_client_t *client) {
    iwn_target_asked_to_stop(self, client);
    self->stopped_us = self->now_us;
    self->stopped_by = client->id;
    iw_gateway_stop(self->core, self->now_us, client->id, IW_CAUSE_CLIENT_STOP);
    iwn_target_judged(self, client, IW_REFUSE_NONE);
    reply_state(self, client);
}

static void do_estop(iwn_server_t *self, iwn_client_t *client) {
    const iw_snapshot_t *const seen = iwn_server_snapshot(self);
    const bool latched = seen->state == IW_STATE_LATCHED;
    const uint32_t number = seen->stop->number;
    iwn_target_asked_to_stop(self, client);
    self->estopped_us = self->now_us;
    self->estopped_by = client->id;
    // Already in effect: repeated requests cost neither a step nor space in the recorder.
    if (!latched || self->now_us - seen->seen_us[IW_CAUSE_ESTOP_SOFTWARE] >= IWN_ESTOP_AGAIN_US) {
        iw_gateway_estop(self->core, self->now_us, client->id);
        iwn_target_judged(self, client, IW_REFUSE_NONE);
    }
    // The reason belongs to the stop. A repeated request makes none.
    if (seen->stop->number != number) {
        memcpy(self->estop_reason, self->request.reason, sizeof self->estop_reason);
    }
    reply_state(self, client);
}

/// Reset or release: only the core judges it, after the target permits it.
static void do_judged(iwn_server_t *self, iwn_client_t *client) {
    if (!iwn_target_permits(self, client)) {
        iwn_server_refuse(self, client, &self->request.id);
        return;
    }
    const iw_refusal_t refusal = (self->request.cmd == IWN_CMD_RESET) ? iw_gateway_reset(self->core, self->now_us)
                                                                      : iw_gateway_release(self->core);
    iwn_target_judged(self, client, refusal);
    if (refusal != IW_REFUSE_NONE) {
        iwn_server_refuse_as(self, client, refusal);
        return;
    }
    reply_state(self, client);
}

static void do_tare(iwn_server_t *self, iwn_client_t *client) {
    const iw_snapshot_t *const seen = iwn_server_snapshot(self);
    const uint8_t sides = self->request.sides;
    const iw_force_t before[IW_SIDES] = {*seen->wheel[IW_LEFT].force, *seen->wheel[IW_RIGHT].force};
    const iw_force_quality_t window[IW_SIDES] = {iw_force_measure(&before[IW_LEFT]),
                                                 iw_force_measure(&before[IW_RIGHT])};
    iw_side_t refused = IW_LEFT;
    const iw_tare_t result = iw_gateway_tare(self->core, self->now_us, sides, &refused);
    if (result != IW_TARE_OK) {
        iwn_refuse_describe_tare(refused, result, &self->refusal);
        iwn_server_refuse(self, client, &self->request.id);
        return;
    }
    iwn_out_t json = iwn_server_begin_reply(self, &self->request.id);
    iwn_out_text(&json, "state", iwn_state_name(seen->state));
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if ((sides & (1U << side)) != 0U) {
            const iw_force_t *const force = seen->wheel[side].force;
            iwn_target_tared(self, client, (iw_side_t)side, &window[side]);
            iwn_out_open(&json, (side == IW_LEFT) ? "left" : "right", '{');
            iwn_write_tare(force, &window[side], &before[side], &json);
            iwn_out_close(&json, '}');
        }
    }
    iwn_server_send_reply(self, client, &json);
}

static void do_why(iwn_server_t *self, iwn_client_t *client) {
    iwn_out_t json = iwn_server_begin_reply(self, &self->request.id);
    iwn_write_stop(&self->last_stop, self->now_us, &json);
    iwn_target_write_why(self, &json);
    iwn_server_send_reply(self, client, &json);
}

/// Executes rare requests.
static void carry_out_seldom(iwn_server_t *self, iwn_client_t *client) {
    switch (self->request.cmd) {
    case IWN_CMD_HELLO:
        do_hello(self, client);
        break;
    case IWN_CMD_WATCH:
        do_watch(self, client);
        break;
    case IWN_CMD_RESET:
    case IWN_CMD_RELEASE:
        do_judged(self, client);
        break;
    case IWN_CMD_TARE:
        do_tare(self, client);
        break;
    case IWN_CMD_WHY:
        do_why(self, client);
        break;
    default:
        iwn_target_other(self, client);
        break;
    }
}

/// There is no table of functions, so that the worst-case stack can be computed from the calls.
static void carry_out(iwn_server_t *self, iwn_client_t *client) {
    switch (self->request.cmd) {
    case IWN_CMD_STATUS:
        iwn_target_status(self, client);
        break;
    case IWN_CMD_ARM:
        do_arm(self, client);
        break;
    case IWN_CMD_DRIVE:
        iwn_server_drive(self, client);
        break;
    case IWN_CMD_TWIST:
        iwn_server_twist(self, client);
        break;
    case IWN_CMD_STOP:
    case IWN_CMD_DISARM:
        do_stop(self, client);
        break;
    case IWN_CMD_ESTOP:
        do_estop(self, client);
        break;
    default:
        carry_out_seldom(self, client);
        break;
    }
}

/// Judges by the age and the stop in the request.
static bool is_late(iwn_server_t *self) {
    if (!self->request.has_t_us && !self->request.has_stop) {
        return false;
    }
    const iw_stop_t *const stop = iwn_server_snapshot(self)->stop;
    const iw_time_us_t asked_us = (self->stopped_us > self->estopped_us) ? self->stopped_us : self->estopped_us;
    const iwn_moment_t moment = {self->now_us, (stop->at_us > asked_us) ? stop->at_us : asked_us, stop->number,
                                 self->max_age_ms};
    return iwn_refuse_late(&self->request, &moment, &self->refusal);
}

void iwn_server_request(iwn_server_t *self, iwn_client_t *client) {
    if (client->watches_only && !iwn_cmd_watches(self->request.cmd)) {
        self->refusal.error = IWN_DENIED;
        iwn_target_refuse_right(self);
        iwn_server_refuse(self, client, &self->request.id);
        return;
    }
    if (is_late(self)) {
        iwn_server_refuse(self, client, &self->request.id);
        return;
    }
    carry_out(self, client);
    iwn_server_observe(self, iwn_server_snapshot(self));
}
