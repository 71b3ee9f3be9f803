// SPDX-License-Identifier: MIT
#include "dispatch.h"

#include "box/box.h"
#include "ledger/knowledge.h"
#include "sockets/clients.h"
#include "status/observe.h"
#include "wheels/wheels.h"

#include "iwheel_northbound/refuse.h"

#include <string.h>

static iwn_out_t begin_reply(const gw_call_t *call) {
    return gw_clients_begin_reply(call->answers->clients, &call->request->id);
}

static void send_refusal(const gw_call_t *call, const iwn_refusal_t *refusal) {
    gw_clients_refuse(call->answers->clients, call->client, &call->request->id, refusal);
}

static void refuse(const gw_call_t *call, iw_refusal_t refusal) {
    iwn_refusal_t words;
    gw_refuse_describe(call->answers, call->request, refusal, &words);
    send_refusal(call, &words);
}

static void reply_state(const gw_call_t *call) {
    iwn_out_t json = begin_reply(call);
    iwn_out_text(&json, "state", iwn_state_name(iw_gateway_state(&call->answers->wheels->core)));
    gw_clients_send_reply(call->client, &json);
}

/// What was asked of the core, for the black box.
static void note(const gw_call_t *call, const blackbox_entry_t *entry) {
    gw_wheels_note(call->answers->wheels, call->client->id, entry);
}

static void do_hello(const gw_call_t *call) {
    iwn_out_t json = begin_reply(call);
    gw_observe_write_hello(call->answers->wheels, call->client, &json);
    gw_clients_send_reply(call->client, &json);
}

static void do_status(const gw_call_t *call) {
    iwn_out_t json = begin_reply(call);
    gw_snapshot_write(call->answers->status, &json);
    gw_clients_send_reply(call->client, &json);
}

static void do_watch(const gw_call_t *call) {
    gw_client_t *client = call->client;
    const bool limited = call->request->rate_hz > IWN_RATE_MAX_HZ;
    client->topics = call->request->topics;
    client->rate_hz = limited ? IWN_RATE_MAX_HZ : (uint32_t)call->request->rate_hz;
    client->next_us = call->answers->wheels->now_us;
    iwn_out_t json = begin_reply(call);
    iwn_tell_watched(client->topics, client->rate_hz, limited, &json);
    gw_clients_send_reply(client, &json);
}

static void reply_armed(gw_answers_t *self, const iw_snapshot_t *seen, gw_client_t *client) {
    const iwn_surroundings_t around = gw_snapshot_around(self->status, seen);
    iwn_out_t json = gw_clients_begin_reply(self->clients, &client->arm_id);
    iwn_tell_terms(seen, &around, &json);
    iwn_out_text(&json, "key", client->key);
    gw_clients_send_reply(client, &json);
}

/// An arm, a reset or a release that waited here, behind an earlier request of its client, is not to undo a stop that came meanwhile.
static bool refuse_waited(const gw_call_t *call) {
    static const iwn_refusal_t refusal = {
        IWN_STALE_COMMAND,
        "this request was sent before somebody else stopped the wheels; see why (iwheelctl why), then send it anew"};
    const bool waited = gw_client_waited_through_stop(call->client);
    if (waited) {
        send_refusal(call, &refusal);
    }
    return waited;
}

static void do_arm(const gw_call_t *call) {
    gw_wheels_t *wheels = call->answers->wheels;
    gw_client_t *client = call->client;
    if (wheels->shutting_down) {
        const iwn_refusal_t refusal = {IWN_DENIED, "the gateway is shutting down; wait until it is started again"};
        send_refusal(call, &refusal);
        return;
    }
    if (refuse_waited(call)) {
        return;
    }
    char key[IWN_LEASE_KEY_MAX + 1U];
    if (!gw_grant_draw_key(key)) {
        const iwn_refusal_t refusal = {IWN_INTERNAL, "the kernel has no random numbers for a key yet; wait a second, "
                                                     "then arm again"};
        send_refusal(call, &refusal);
        return;
    }
    const iw_refusal_t refusal = iw_gateway_arm(&wheels->core, wheels->now_us, client->id, call->request->takeover);
    note(call, &(blackbox_entry_t){.kind = BLACKBOX_ARM, .a = call->request->takeover, .b = (uint8_t)refusal});
    if (refusal != IW_REFUSE_NONE) {
        refuse(call, refusal);
        return;
    }
    if (call->request->name[0] != '\0') {
        memcpy(client->name, call->request->name, sizeof client->name);
    }
    memcpy(client->key, key, sizeof client->key);
    client->arming = true;
    client->arm_id = call->request->id;
    wheels->requested = true;
}

void gw_dispatch_arming(gw_answers_t *self, const iw_snapshot_t *seen) {
    const gw_clients_t *clients = self->clients;
    for (uint32_t i = gw_clients_from(clients, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(clients, i + 1U)) {
        gw_client_t *client = &self->clients->client[i];
        const bool holds = seen->holder == client->id;
        if (!client->arming || (holds && seen->arming)) {
            continue;
        }
        client->arming = false;
        gw_client_check_caught_up(client, self->wheels->now_us);
        if (holds && seen->state == IW_STATE_ARMED) {
            reply_armed(self, seen, client);
            continue;
        }
        const iwn_request_t request = {.cmd = IWN_CMD_ARM, .id = client->arm_id};
        refuse(&(gw_call_t){self, client, &request},
               (seen->arm_refusal == IW_REFUSE_NONE) ? IW_REFUSE_NOT_ARMED : seen->arm_refusal);
    }
}

/// A number too large for the core is too large for the wheels: the core refuses it by its range.
static int32_t saturate(int64_t value) {
    return (value > INT32_MAX) ? INT32_MAX : (value < INT32_MIN) ? INT32_MIN : (int32_t)value;
}

static iw_refusal_t judge_drive(const gw_call_t *call, const iw_drive_t *wanted, iw_applied_t *out_applied) {
    gw_wheels_t *wheels = call->answers->wheels;
    const iw_time_us_t armed_us = gw_wheels_look(wheels).armed_us;
    const iw_time_us_t sent_us =
        gw_client_sent_us(call->client, wheels->now_us, armed_us); // It may have waited for us.
    const iw_refusal_t refusal = iw_gateway_drive(&wheels->core, sent_us, call->client->id, wanted, out_applied);
    const blackbox_entry_t entry = {.at_us = wheels->now_us, .number = call->client->id, .b = (uint8_t)refusal};
    gw_tape_drive(&wheels->tape, &entry, wanted, sent_us);
    return refusal;
}

/// A command that is refused before the core judges it: to the core one that is out of range, so that it is remembered as one that
/// nobody may arm into.
static void remember_wish(const gw_call_t *call) {
    const iw_drive_t unknown = {.speed_mm_s = {INT32_MAX, INT32_MAX}};
    iw_applied_t applied;
    (void)judge_drive(call, &unknown, &applied);
}

/// A command of the holder's connection with another key is another person's. Where the core refuses it in any case, its reason
/// says more.
static bool refuse_key(const gw_call_t *call, const iw_drive_t *wanted) {
    static const iwn_refusal_t refusal = {IWN_NOT_HOLDER, "the key is not the one that the reply to the last arm gave; "
                                                          "arm, and drive with the key of its reply"};
    const char *key = call->request->lease_key;
    if (key[0] == '\0' || gw_grant_is_same_key(key, call->client->key)) {
        return false;
    }
    const iw_snapshot_t seen = gw_wheels_look(call->answers->wheels);
    if (seen.state != IW_STATE_ARMED || seen.holder != call->client->id) {
        return false;
    }
    const bool current = wanted->has_current && seen.config->current_role == IW_ROLE_SETPOINT &&
                         (wanted->current_mA[IW_LEFT] != 0 || wanted->current_mA[IW_RIGHT] != 0);
    if (current || wanted->speed_mm_s[IW_LEFT] != 0 || wanted->speed_mm_s[IW_RIGHT] != 0) {
        remember_wish(call);
    }
    send_refusal(call, &refusal);
    return true;
}

static void drive(const gw_call_t *call, const iw_drive_t *wanted) {
    iw_applied_t applied;
    if (refuse_key(call, wanted)) {
        return;
    }
    const iw_refusal_t refusal = judge_drive(call, wanted, &applied);
    if (refusal != IW_REFUSE_NONE) {
        refuse(call, refusal);
        return;
    }
    call->answers->wheels->requested = true;
    iwn_out_t json = begin_reply(call);
    iwn_tell_applied(&applied, &json);
    gw_clients_send_reply(call->client, &json);
}

static void do_drive(const gw_call_t *call) {
    const iwn_request_t *request = call->request;
    const iw_drive_t wanted = {
        .speed_mm_s = {saturate(request->left_mm_s), saturate(request->right_mm_s)},
        .current_mA = {saturate(request->left_mA), saturate(request->right_mA)},
        .has_current = request->has_current,
    };
    drive(call, &wanted);
}

/// A turn for which no speeds are known.
static void refuse_turn(const gw_call_t *call) {
    iwn_refusal_t refusal = {.error = IWN_DENIED};
    remember_wish(call);
    gw_knowledge_describe_contradiction(call->answers->knowledge, IW_LEDGER_TRACK, refusal.message,
                                        sizeof refusal.message);
    send_refusal(call, &refusal);
}

static void do_twist(const gw_call_t *call) {
    const int64_t limit = 1000000; // Far outside, and no product of it overflows.
    const int64_t v = call->request->v_mm_s;
    const int64_t yaw = call->request->yaw_mrad_s;
    const int64_t v_mm_s = (v > limit) ? limit : (v < -limit) ? -limit : v;
    const int64_t yaw_mrad_s = (yaw > limit) ? limit : (yaw < -limit) ? -limit : yaw;
    if (yaw != 0 && gw_wheels_look(call->answers->wheels).assumed[IW_LEDGER_TRACK].state == IW_LEDGER_CONTRADICTED) {
        refuse_turn(call);
        return;
    }
    const int64_t rim_mm_s = yaw_mrad_s * (int64_t)call->answers->knowledge->configured.track_mm / 2000;
    const iw_drive_t wanted = {.speed_mm_s = {saturate(v_mm_s - rim_mm_s), saturate(v_mm_s + rim_mm_s)}};
    drive(call, &wanted);
}

static gw_stopper_t stopper_of(const gw_call_t *call) {
    return (gw_stopper_t){.at_us = call->answers->wheels->now_us, .pid = call->client->pid, .uid = call->client->uid};
}

static void do_stop(const gw_call_t *call) {
    gw_clients_note_stop(call->answers->clients, call->client);
    call->answers->status->stopped_by = stopper_of(call);
    gw_wheels_stop(call->answers->wheels, call->client->id, IW_CAUSE_CLIENT_STOP);
    reply_state(call);
}

static void do_estop(const gw_call_t *call) {
    gw_wheels_t *wheels = call->answers->wheels;
    gw_status_t *status = call->answers->status;
    const iw_snapshot_t seen = gw_wheels_look(wheels);
    gw_clients_note_stop(call->answers->clients, call->client);
    status->estopped_by = stopper_of(call);
    if (seen.state == IW_STATE_LATCHED && wheels->now_us - seen.seen_us[IW_CAUSE_ESTOP_SOFTWARE] < GW_ESTOP_AGAIN_US) {
        reply_state(call); // In force already: a flood of it costs neither a step nor what the black box holds.
        return;
    }
    if (seen.state != IW_STATE_LATCHED) {
        memcpy(status->estop_reason, call->request->reason, sizeof status->estop_reason);
    }
    iw_gateway_estop(&wheels->core, wheels->now_us, call->client->id);
    note(call, &(blackbox_entry_t){.kind = BLACKBOX_ESTOPPED});
    wheels->requested = true;
    reply_state(call);
}

/// What the core has made of a request of that kind, and the state after it.
static void reply_judged(const gw_call_t *call, blackbox_kind_t kind, iw_refusal_t refusal) {
    note(call, &(blackbox_entry_t){.kind = (uint8_t)kind, .b = (uint8_t)refusal});
    if (refusal != IW_REFUSE_NONE) {
        refuse(call, refusal);
        return;
    }
    call->answers->wheels->requested = true;
    reply_state(call);
}

static void do_reset(const gw_call_t *call) {
    gw_wheels_t *wheels = call->answers->wheels;
    if (!refuse_waited(call)) {
        reply_judged(call, BLACKBOX_RESET, iw_gateway_reset(&wheels->core, wheels->now_us));
    }
}

/// It permits motion as `arm` does: in time, and not behind a stop of somebody else.
static void do_release(const gw_call_t *call) {
    if (!refuse_waited(call)) {
        reply_judged(call, BLACKBOX_RELEASE, iw_gateway_release(&call->answers->wheels->core));
    }
}

static void do_tare(const gw_call_t *call) {
    gw_knowledge_t *knowledge = call->answers->knowledge;
    const iw_snapshot_t seen = gw_wheels_look(call->answers->wheels);
    const iw_force_t before[IW_SIDES] = {*seen.wheel[IW_LEFT].force, *seen.wheel[IW_RIGHT].force};
    iw_side_t refused = IW_LEFT;
    const iw_tare_t result = gw_knowledge_tare(knowledge, call->request->sides, &refused);
    if (result != IW_TARE_OK) {
        iwn_refusal_t words;
        iwn_refuse_describe_tare(refused, result, &words);
        send_refusal(call, &words);
        return;
    }
    iwn_out_t json = begin_reply(call);
    iwn_out_text(&json, "state", iwn_state_name(seen.state));
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if ((call->request->sides & (1U << side)) != 0U) {
            note(call, &(blackbox_entry_t){.kind = BLACKBOX_TARE, .a = (uint8_t)side, .b = (uint8_t)result});
            iwn_out_open(&json, (side == IW_LEFT) ? "left" : "right", '{');
            iwn_tell_tare(seen.wheel[side].force, &knowledge->tare[side], &before[side], &json);
            iwn_out_close(&json, '}');
        }
    }
    gw_clients_send_reply(call->client, &json);
}

/// The operator's word. Moves nothing; what it contradicts is disabled from now on.
static void do_confirm(const gw_call_t *call) {
    gw_knowledge_t *knowledge = call->answers->knowledge;
    const iwn_request_t *request = call->request;
    iwn_refusal_t words;
    gw_word_t word;
    memcpy(word.found, request->value, sizeof word.found);
    memcpy(word.how, request->how, sizeof word.how);
    if (!gw_knowledge_confirm(knowledge, request->item, &word, &words)) {
        send_refusal(call, &words);
        return;
    }
    iwn_out_t json = begin_reply(call);
    iwn_out_text(&json, "item", iwn_ledger_item_name(request->item));
    gw_knowledge_write_item(knowledge, request->item, &json);
    gw_clients_send_reply(call->client, &json);
}

/// A file that an administrator writes is not to be changed by whoever may drive.
static void do_config(const gw_call_t *call) {
    const iwn_refusal_t refusal = {IWN_DENIED, "this gateway's configuration is a file: change it, look at it with "
                                               "iwheel-gateway --check -c FILE, and start the gateway again"};
    send_refusal(call, &refusal);
}

static void do_why(const gw_call_t *call) {
    const iwn_stop_note_t *note = &call->answers->status->last_stop;
    iwn_out_t json = begin_reply(call);
    iwn_tell_stop(note, call->answers->wheels->now_us, &json);
    gw_record_write(call->answers->box, note->stop.number, &json);
    gw_wheels_write_around(call->answers->wheels, &json);
    gw_clients_send_reply(call->client, &json);
}

/// What has come of a request or a leaving client, told while it is still known who it was.
static void observe(gw_answers_t *self) {
    const iw_snapshot_t seen = gw_wheels_look(self->wheels);
    gw_observe(self->status, &seen);
}

static void carry_out(void *context, gw_client_t *client, const char *line, size_t length) {
    static void (*const handlers[IWN_CMDS])(const gw_call_t *call) = {
        [IWN_CMD_HELLO] = do_hello,
        [IWN_CMD_STATUS] = do_status,
        [IWN_CMD_WATCH] = do_watch,
        [IWN_CMD_ARM] = do_arm,
        [IWN_CMD_DRIVE] = do_drive,
        [IWN_CMD_TWIST] = do_twist,
        [IWN_CMD_STOP] = do_stop,
        [IWN_CMD_DISARM] = do_stop,
        [IWN_CMD_ESTOP] = do_estop,
        [IWN_CMD_RESET] = do_reset,
        [IWN_CMD_RELEASE] = do_release,
        [IWN_CMD_TARE] = do_tare,
        [IWN_CMD_WHY] = do_why,
        [IWN_CMD_CONFIRM] = do_confirm,
        [IWN_CMD_RECORDINGS] = gw_recordings_ask,
        [IWN_CMD_RECORDING] = gw_recordings_ask,
        [IWN_CMD_CONFIG] = do_config,
    };
    gw_answers_t *self = (gw_answers_t *)context;
    iwn_request_t request;
    iwn_refusal_t refusal;
    const gw_call_t call = {self, client, &request};
    const bool is_right = iwn_request_read(line, length, &self->work, &request, &refusal);
    const bool stops = is_right && iwn_cmd_stops(request.cmd);
    if (client->closing && !stops) {
        return;
    }
    if (client->right == GW_STOP && !stops) {
        gw_service_refuse_crowd(self->clients, client, &refusal);
        send_refusal(&call, &refusal);
        return;
    }
    if (!is_right || gw_refuse_by_right(self, client->right, request.cmd, &refusal) ||
        gw_grant_is_late(self, &request, &refusal)) {
        send_refusal(&call, &refusal);
        return;
    }
    gw_wheels_time_request(self->wheels);
    handlers[request.cmd](&call);
    observe(self);
}

static void leave(void *context, gw_client_t *client) {
    gw_answers_t *self = (gw_answers_t *)context;
    gw_wheels_time_request(self->wheels);
    gw_wheels_leave(self->wheels, client->id);
    client->arming = false;
    observe(self);
}

static void welcome(void *context, gw_client_t *client) {
    gw_observe_hello(((gw_answers_t *)context)->status, client);
}

gw_servant_t gw_dispatch_servant(gw_answers_t *self) {
    return (gw_servant_t){.welcome = welcome, .carry_out = carry_out, .leave = leave, .context = self};
}
