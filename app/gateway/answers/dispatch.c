// SPDX-License-Identifier: MIT
#include "dispatch.h"

#include "assumption.h"
#include "box/record.h"
#include "ledger/knowledge.h"
#include "recordings.h"
#include "refuse.h"
#include "status/observe.h"
#include "status/snapshot.h"

#include "iwheel_linux/clock.h"

#include <stdio.h>
#include <string.h>

/// One request being carried out.
typedef struct {
    gw_daemon_t *daemon;
    gw_client_t *client;
    const iwn_request_t *request;
} call_t;

static void write_id(iwn_out_t *json, const iwn_id_t *id) {
    if (id->kind == IWN_ID_NUMBER) {
        iwn_out_int(json, "id", id->number);
    } else {
        iwn_out_text(json, "id", (id->kind == IWN_ID_TEXT) ? id->text : NULL);
    }
}

iwn_out_t gw_dispatch_begin_reply(gw_daemon_t *daemon, const iwn_id_t *id) {
    iwn_out_t json;
    iwn_out_init(&json, daemon->line, sizeof daemon->line);
    iwn_out_open(&json, NULL, '{');
    write_id(&json, id);
    iwn_out_bool(&json, "ok", true);
    return json;
}

static void send_reply(gw_client_t *client, iwn_out_t *json) {
    iwn_out_close(json, '}');
    gw_client_reply(client, json->data, iwn_out_finish(json));
}

size_t gw_dispatch_write_refusal(gw_daemon_t *daemon, const iwn_id_t *id, const iwn_refusal_t *refusal) {
    iwn_out_t json;
    iwn_out_init(&json, daemon->line, sizeof daemon->line);
    iwn_out_open(&json, NULL, '{');
    write_id(&json, id);
    iwn_out_bool(&json, "ok", false);
    iwn_out_text(&json, "error", iwn_error_name(refusal->error));
    iwn_out_text(&json, "message", refusal->message);
    iwn_out_close(&json, '}');
    return iwn_out_finish(&json);
}

static void send_refusal(gw_daemon_t *daemon, gw_client_t *client, const iwn_id_t *id, const iwn_refusal_t *refusal) {
    gw_client_reply(client, daemon->line, gw_dispatch_write_refusal(daemon, id, refusal));
}

static void refuse(const call_t *call, iw_refusal_t refusal) {
    iwn_refusal_t words;
    gw_refuse_describe(call->daemon, call->request, refusal, &words);
    send_refusal(call->daemon, call->client, &call->request->id, &words);
}

static void reply_state(const call_t *call) {
    iwn_out_t json = gw_dispatch_begin_reply(call->daemon, &call->request->id);
    iwn_out_text(&json, "state", iwn_state_name(iw_gateway_state(&call->daemon->gateway)));
    send_reply(call->client, &json);
}

/// What was asked of the core, for the black box.
static void note(const call_t *call, const blackbox_entry_t *entry) {
    blackbox_entry_t whole = *entry;
    whole.at_us = call->daemon->now_us;
    whole.number = call->client->id;
    gw_tape_put(&call->daemon->tape, &whole);
}

static void do_hello(const call_t *call) {
    iwn_out_t json = gw_dispatch_begin_reply(call->daemon, &call->request->id);
    gw_observe_write_hello(call->daemon, call->client, &json);
    send_reply(call->client, &json);
}

static void do_status(const call_t *call) {
    iwn_out_t json = gw_dispatch_begin_reply(call->daemon, &call->request->id);
    gw_snapshot_write(call->daemon, &json);
    send_reply(call->client, &json);
}

static void do_watch(const call_t *call) {
    gw_client_t *client = call->client;
    const bool limited = call->request->rate_hz > IWN_RATE_MAX_HZ;
    client->topics = call->request->topics;
    client->rate_hz = limited ? IWN_RATE_MAX_HZ : (uint32_t)call->request->rate_hz;
    client->next_us = call->daemon->now_us;
    iwn_out_t json = gw_dispatch_begin_reply(call->daemon, &call->request->id);
    iwn_out_open(&json, "topics", '[');
    for (unsigned topic = 0; topic < IWN_TOPICS; topic++) {
        if ((client->topics & (1U << topic)) != 0U) {
            iwn_out_text(&json, NULL, iwn_topic_name((iwn_topic_t)topic));
        }
    }
    iwn_out_close(&json, ']');
    iwn_out_int(&json, "rate_hz", client->rate_hz);
    iwn_out_bool(&json, "limited", limited);
    send_reply(client, &json);
}

static void reply_armed(gw_daemon_t *daemon, const iw_snapshot_t *seen, gw_client_t *client) {
    const iw_stop_budget_t budget = iw_config_stop_budget(seen->config);
    iwn_out_t json = gw_dispatch_begin_reply(daemon, &client->arm_id);
    iwn_out_text(&json, "state", iwn_state_name(seen->state));
    iwn_out_int(&json, "lease_ms", seen->config->lease_ms);
    iwn_out_int(&json, "first_lease_ms", IW_FIRST_LEASE_US / IW_US_PER_MS);
    iwn_out_int(&json, "stop_budget_ms", budget.client_lost_ms);
    iwn_out_int(&json, "stop_budget_mm", budget.client_lost_mm);
    iwn_out_open(&json, "warnings", '[');
    for (uint32_t i = 0; i < daemon->warnings; i++) {
        iwn_out_text(&json, NULL, daemon->warning[i]);
    }
    iwn_out_close(&json, ']');
    send_reply(client, &json);
}

static void do_arm(const call_t *call) {
    gw_daemon_t *daemon = call->daemon;
    gw_client_t *client = call->client;
    if (daemon->shutting_down) {
        const iwn_refusal_t refusal = {IWN_DENIED, "the gateway is shutting down; wait until it is started again"};
        send_refusal(daemon, client, &call->request->id, &refusal);
        return;
    }
    const iw_refusal_t refusal = iw_gateway_arm(&daemon->gateway, daemon->now_us, client->id, call->request->takeover);
    note(call, &(blackbox_entry_t){.kind = BLACKBOX_ARM, .a = call->request->takeover, .b = (uint8_t)refusal});
    if (refusal != IW_REFUSE_NONE) {
        refuse(call, refusal);
        return;
    }
    if (call->request->name[0] != '\0') {
        memcpy(client->name, call->request->name, sizeof client->name);
    }
    client->arming = true;
    client->arm_id = call->request->id;
    daemon->requested = true;
}

void gw_dispatch_arming(gw_daemon_t *daemon) {
    const iw_snapshot_t seen = gw_daemon_look(daemon);
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        gw_client_t *client = &daemon->client[i];
        const bool holds = seen.holder == client->id;
        if (client->id == IW_CLIENT_NONE || !client->arming || (holds && seen.arming)) {
            continue;
        }
        client->arming = false;
        gw_client_check_caught_up(client, daemon->now_us);
        if (holds && seen.state == IW_STATE_ARMED) {
            reply_armed(daemon, &seen, client);
            continue;
        }
        const iwn_request_t request = {.cmd = IWN_CMD_ARM};
        const iw_refusal_t refusal = seen.arm_refusal;
        iwn_refusal_t words;
        gw_refuse_describe(daemon, &request, (refusal == IW_REFUSE_NONE) ? IW_REFUSE_NOT_ARMED : refusal, &words);
        send_refusal(daemon, client, &client->arm_id, &words);
    }
}

/// A number too large for the core is too large for the wheels: the core refuses it by its range.
static int32_t saturate(int64_t value) {
    return (value > INT32_MAX) ? INT32_MAX : (value < INT32_MIN) ? INT32_MIN : (int32_t)value;
}

static iw_refusal_t judge_drive(const call_t *call, const iw_drive_t *wanted, iw_applied_t *out_applied) {
    gw_daemon_t *daemon = call->daemon;
    const iw_time_us_t armed_us = gw_daemon_look(daemon).armed_us;
    const iw_time_us_t sent_us =
        gw_client_sent_us(call->client, daemon->now_us, armed_us); // It may have waited for us.
    const iw_refusal_t refusal = iw_gateway_drive(&daemon->gateway, sent_us, call->client->id, wanted, out_applied);
    const blackbox_entry_t entry = {.at_us = daemon->now_us, .number = call->client->id, .b = (uint8_t)refusal};
    gw_tape_drive(&daemon->tape, &entry, wanted, sent_us);
    return refusal;
}

static void drive(const call_t *call, const iw_drive_t *wanted) {
    iw_applied_t applied;
    const iw_refusal_t refusal = judge_drive(call, wanted, &applied);
    if (refusal != IW_REFUSE_NONE) {
        refuse(call, refusal);
        return;
    }
    call->daemon->requested = true;
    iwn_out_t json = gw_dispatch_begin_reply(call->daemon, &call->request->id);
    iwn_out_int(&json, "left_mm_s", applied.pair.wheel[IW_LEFT].speed_mm_s);
    iwn_out_int(&json, "right_mm_s", applied.pair.wheel[IW_RIGHT].speed_mm_s);
    iwn_out_int(&json, "left_mA", applied.pair.wheel[IW_LEFT].current_mA);
    iwn_out_int(&json, "right_mA", applied.pair.wheel[IW_RIGHT].current_mA);
    iwn_out_bool(&json, "limited", applied.limited);
    send_reply(call->client, &json);
}

static void do_drive(const call_t *call) {
    const iwn_request_t *request = call->request;
    const iw_drive_t wanted = {
        .speed_mm_s = {saturate(request->left_mm_s), saturate(request->right_mm_s)},
        .current_mA = {saturate(request->left_mA), saturate(request->right_mA)},
        .has_current = request->has_current,
    };
    drive(call, &wanted);
}

/// A turn for which no speeds are known: to the core a command that is out of range, so that it is remembered as one
/// that nobody may arm into.
static void refuse_turn(const call_t *call) {
    const iw_drive_t unknown = {.speed_mm_s = {INT32_MAX, INT32_MAX}};
    iw_applied_t applied;
    iwn_refusal_t refusal;
    (void)judge_drive(call, &unknown, &applied);
    gw_refuse_describe_contradicted(call->daemon, IW_LEDGER_TRACK, &refusal);
    send_refusal(call->daemon, call->client, &call->request->id, &refusal);
}

static void do_twist(const call_t *call) {
    const int64_t limit = 1000000; // Far outside, and no product of it overflows.
    const int64_t v = call->request->v_mm_s;
    const int64_t yaw = call->request->yaw_mrad_s;
    const int64_t v_mm_s = (v > limit) ? limit : (v < -limit) ? -limit : v;
    const int64_t yaw_mrad_s = (yaw > limit) ? limit : (yaw < -limit) ? -limit : yaw;
    if (yaw != 0 && gw_daemon_look(call->daemon).assumed[IW_LEDGER_TRACK].state == IW_LEDGER_CONTRADICTED) {
        refuse_turn(call);
        return;
    }
    const int64_t rim_mm_s = yaw_mrad_s * call->daemon->config.track_mm / 2000;
    const iw_drive_t wanted = {.speed_mm_s = {saturate(v_mm_s - rim_mm_s), saturate(v_mm_s + rim_mm_s)}};
    drive(call, &wanted);
}

static gw_stopper_t stopper_of(const call_t *call) {
    return (gw_stopper_t){.at_us = call->daemon->now_us, .pid = call->client->pid, .uid = call->client->uid};
}

static void do_stop(const call_t *call) {
    call->daemon->stopped_by = stopper_of(call);
    iw_gateway_stop(&call->daemon->gateway, call->daemon->now_us, call->client->id, IW_CAUSE_CLIENT_STOP);
    note(call, &(blackbox_entry_t){.kind = BLACKBOX_STOP, .a = IW_CAUSE_CLIENT_STOP});
    call->daemon->requested = true;
    reply_state(call);
}

static void do_estop(const call_t *call) {
    gw_daemon_t *daemon = call->daemon;
    const iw_snapshot_t seen = gw_daemon_look(daemon);
    daemon->estopped_by = stopper_of(call);
    if (seen.state == IW_STATE_LATCHED && daemon->now_us - seen.seen_us[IW_CAUSE_ESTOP_SOFTWARE] < GW_ESTOP_AGAIN_US) {
        reply_state(call); // In force already: a flood of it costs neither a step nor what the black box holds.
        return;
    }
    if (iw_gateway_state(&daemon->gateway) != IW_STATE_LATCHED) {
        memcpy(daemon->estop_reason, call->request->reason, sizeof daemon->estop_reason);
    }
    iw_gateway_estop(&daemon->gateway, daemon->now_us, call->client->id);
    note(call, &(blackbox_entry_t){.kind = BLACKBOX_ESTOPPED});
    daemon->requested = true;
    reply_state(call);
}

static void do_reset(const call_t *call) {
    const iw_refusal_t refusal = iw_gateway_reset(&call->daemon->gateway, call->daemon->now_us);
    note(call, &(blackbox_entry_t){.kind = BLACKBOX_RESET, .b = (uint8_t)refusal});
    if (refusal != IW_REFUSE_NONE) {
        refuse(call, refusal);
        return;
    }
    call->daemon->requested = true;
    reply_state(call);
}

/// What was in force before a tare.
typedef struct {
    iw_offset_provenance_t provenance;
    iw_time_us_t offset_us;
    int32_t offset_mN;
} zero_t;

static zero_t zero_of(const iw_force_t *force) {
    return (zero_t){.provenance = force->provenance, .offset_us = force->offset_us, .offset_mN = force->offset_mN};
}

/// The zero of one wheel after a tare, and before.
static void write_tare(const iw_force_t *force, const iw_force_quality_t *quality, const zero_t *before,
                       iwn_out_t *json) {
    iwn_out_int(json, "offset_mN", force->offset_mN);
    iwn_out_int(json, "samples", quality->samples);
    iwn_out_int(json, "deviation_mN", quality->deviation_mN);
    iwn_out_int(json, "drift_mN", quality->drift_mN);
    iwn_out_known(json, "before_mN", before->provenance != IW_OFFSET_NONE, before->offset_mN);
    iwn_out_text(json, "before_provenance", iwn_offset_word(before->provenance, before->offset_us));
}

static void do_tare(const call_t *call) {
    gw_daemon_t *daemon = call->daemon;
    const iw_snapshot_t seen = gw_daemon_look(daemon);
    const zero_t before[IW_SIDES] = {zero_of(seen.wheel[IW_LEFT].force), zero_of(seen.wheel[IW_RIGHT].force)};
    iw_side_t refused = IW_LEFT;
    const iw_tare_t result = gw_knowledge_tare(daemon, call->request->sides, &refused);
    if (result != IW_TARE_OK) {
        iwn_refusal_t words;
        gw_refuse_describe_tare(refused, result, &words);
        send_refusal(daemon, call->client, &call->request->id, &words);
        return;
    }
    iwn_out_t json = gw_dispatch_begin_reply(daemon, &call->request->id);
    iwn_out_text(&json, "state", iwn_state_name(seen.state));
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if ((call->request->sides & (1U << side)) != 0U) {
            note(call, &(blackbox_entry_t){.kind = BLACKBOX_TARE, .a = (uint8_t)side, .b = (uint8_t)result});
            iwn_out_open(&json, (side == IW_LEFT) ? "left" : "right", '{');
            write_tare(seen.wheel[side].force, &daemon->knowledge.tare[side], &before[side], &json);
            iwn_out_close(&json, '}');
        }
    }
    send_reply(call->client, &json);
}

static void reply_item(const call_t *call) {
    iwn_out_t json = gw_dispatch_begin_reply(call->daemon, &call->request->id);
    iwn_out_text(&json, "item", iwn_ledger_item_name(call->request->item));
    gw_knowledge_write_item(call->daemon, call->request->item, &json);
    send_reply(call->client, &json);
}

/// The operator's word. Moves nothing; what it contradicts is disabled from now on.
static void do_confirm(const call_t *call) {
    const iwn_request_t *request = call->request;
    const char *name = iwn_ledger_item_name(request->item);
    iwn_refusal_t words;
    gw_word_t word;
    memcpy(word.found, request->value, sizeof word.found);
    memcpy(word.how, request->how, sizeof word.how);
    switch (gw_knowledge_confirm(call->daemon, request->item, &word)) {
    case GW_FOUND_SAME:
    case GW_FOUND_DIFFERENT:
        gw_knowledge_observe(call->daemon); // So that the reply has it all.
        reply_item(call);
        return;
    case GW_FOUND_UNSET:
        words.error = IWN_TYPE_NOT_SET;
        (void)snprintf(words.message, sizeof words.message,
                       "%s is not configured, so there is nothing to confirm; set it under [wheels] first", name);
        break;
    case GW_FOUND_IMPOSSIBLE:
    default:
        words.error = IWN_BAD_VALUE;
        (void)snprintf(words.message, sizeof words.message,
                       "value of %s must be %s; leave it out to confirm what is configured", name,
                       gw_assumption_values(request->item));
        break;
    }
    send_refusal(call->daemon, call->client, &request->id, &words);
}

static void do_why(const call_t *call) {
    iwn_out_t json = gw_dispatch_begin_reply(call->daemon, &call->request->id);
    gw_snapshot_write_stop(call->daemon, &json);
    gw_record_write(call->daemon, &json);
    send_reply(call->client, &json);
}

static void do_recordings(const call_t *call) {
    gw_recordings_ask(call->daemon, call->client, call->request);
}

void gw_dispatch_line(gw_daemon_t *daemon, gw_client_t *client, const char *line, size_t length) {
    static void (*const handlers[IWN_CMDS])(const call_t *call) = {
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
        [IWN_CMD_TARE] = do_tare,
        [IWN_CMD_WHY] = do_why,
        [IWN_CMD_CONFIRM] = do_confirm,
        [IWN_CMD_RECORDINGS] = do_recordings,
        [IWN_CMD_RECORDING] = do_recordings,
    };
    iwn_request_t request;
    iwn_refusal_t refusal;
    if (!iwn_request_read(line, length, &daemon->work, &request, &refusal) ||
        gw_refuse_by_right(daemon, client->right, request.cmd, &refusal)) {
        send_refusal(daemon, client, &request.id, &refusal);
        return;
    }
    daemon->now_us = iw_clock_now_us();
    const call_t call = {daemon, client, &request};
    handlers[request.cmd](&call);
    gw_observe(daemon); // While it is still known who asked.
}
