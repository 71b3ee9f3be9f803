// SPDX-License-Identifier: MIT
// What each request does: the same core, words and replies as the daemon's.
#include "host.h"

#include <string.h>

/// A software e-stop that is in force is not put in force again within this time: a flood of it costs no step.
#define ESTOP_AGAIN_US 200000U

static void send_refusal(iw_host_t *self, iw_host_client_t *client) {
    iw_host_send_refusal(self, client, &self->request.id);
}

static void refuse_as(iw_host_t *self, iw_host_client_t *client, iwn_error_t error, const char *const *texts) {
    iwn_text_t message = iwn_text_begin(self->refusal.message, sizeof self->refusal.message);
    self->refusal.error = error;
    iwn_text_join(&message, texts);
    send_refusal(self, client);
}

#define REFUSE(self, client, error, ...) refuse_as((self), (client), (error), (const char *const[]){__VA_ARGS__, NULL})

void iw_answer_refuse(iw_host_t *self, iw_host_client_t *client, iw_refusal_t refusal) {
    const iw_snapshot_t *const seen = iw_host_look(self);
    const iwn_refuse_context_t context = {
        .seen = seen,
        .holder = iw_host_name(self, seen->holder, 0),
        .stale_client = iw_host_name(self, seen->stale_client, 1),
        .last_stop = self->stop.sentence,
        .stopped_by = (self->stopped_us > 0U) ? iw_host_name(self, self->stopped_by, 2) : NULL,
        .estopped_by = (self->estopped_us > 0U) ? iw_host_name(self, self->estopped_by, 3) : NULL,
        .estopped_us = self->estopped_us,
        .estop = self->place.estop,
        .estop_answer = self->estop_high ? 1 : 0,
        .bus = self->place.bus,
        .bus_cure = "check cable, termination, transceiver and that the wheels have power",
        .timing = "the bit timing of the bus is wrong; report this",
        .contradiction = "an assumption that motion depends on is contradicted; see: iwheelctl ledger",
        .configure = "by the request config (wheels.setpoint_type and wheels.current_role) and commit",
        .listen_only = "the image never sends; build it without listen only",
    };
    iwn_refuse_describe(&context, &self->request, refusal, &self->refusal);
    send_refusal(self, client);
}

static void reply_state(iw_host_t *self, iw_host_client_t *client) {
    iwn_out_t json = iw_host_begin_reply(self, &self->request.id);
    iwn_out_text(&json, "state", iwn_state_name(iw_gateway_state(self->place.gateway)));
    iw_host_send_reply(self, client, &json);
}

static void do_hello(iw_host_t *self, iw_host_client_t *client) {
    const iwn_hello_t hello = {.version = self->place.version,
                               .bus = self->place.bus,
                               .state = iw_gateway_state(self->place.gateway),
                               .client = client->id,
                               .watches_only = client->watches_only};
    iwn_out_t json = iw_host_begin_reply(self, &self->request.id);
    iwn_tell_hello(&hello, &json);
    iw_host_send_reply(self, client, &json);
}

/// Told when the long line is free.
static void do_status(iw_host_t *self, iw_host_client_t *client) {
    if (client->owed_status) {
        REFUSE(self, client, IWN_BUSY, "the answer to an earlier status still waits for the serial line; wait for it");
        return;
    }
    client->owed_status = true; // A status of every client has a place.
    iw_pending_put(&self->pending, client->id, IWN_CMD_STATUS, &self->request.id);
}

static void do_watch(iw_host_t *self, iw_host_client_t *client) {
    const bool limited = self->request.rate_hz > (int64_t)self->place.rate_max_hz;
    client->topics = self->request.topics & (uint8_t) ~(1U << IWN_TOPIC_FRAME); // The serial line cannot carry the bus.
    client->rate_hz = limited ? self->place.rate_max_hz : (uint32_t)self->request.rate_hz;
    client->next_us = self->now_us;
    client->owed_state = false;
    iwn_out_t json = iw_host_begin_reply(self, &self->request.id);
    iwn_tell_watched(client->topics, client->rate_hz, limited || client->topics != self->request.topics, &json);
    iw_host_send_reply(self, client, &json);
}

static void do_arm(iw_host_t *self, iw_host_client_t *client) {
    if (self->restart_us != 0U) {
        REFUSE(self, client, IWN_DENIED, "a configuration was committed: the gateway starts anew with it, then arm");
        return;
    }
    if (!iw_pending_has_room(&self->pending, client->id, IWN_CMD_ARM)) {
        REFUSE(self, client, IWN_BUSY, "the answers to other requests still wait for the serial line; try again");
        return;
    }
    const iw_refusal_t refusal = iw_gateway_arm(self->place.gateway, self->now_us, client->id, self->request.takeover);
    if (refusal != IW_REFUSE_NONE) {
        iw_answer_refuse(self, client, refusal);
        return;
    }
    if (self->request.name[0] != '\0') {
        memcpy(client->name, self->request.name, sizeof client->name);
    }
    client->arming = true;
    iw_pending_put(&self->pending, client->id, IWN_CMD_ARM, &self->request.id);
}

void iw_answer_arming(iw_host_t *self, iw_host_client_t *client, const iw_snapshot_t *seen) {
    const iwn_id_t *const id = iw_pending_take(&self->pending, client->id, IWN_CMD_ARM);
    if (seen->holder == client->id && seen->state == IW_STATE_ARMED) {
        const iwn_surroundings_t around = iw_host_around(self, seen);
        iwn_out_t json = iw_host_begin_reply(self, id);
        iwn_tell_terms(seen, &around, &json);
        iw_host_send_reply(self, client, &json);
        return;
    }
    self->request = (iwn_request_t){.cmd = IWN_CMD_ARM, .id = *id};
    iw_answer_refuse(self, client, (seen->arm_refusal == IW_REFUSE_NONE) ? IW_REFUSE_NOT_ARMED : seen->arm_refusal);
}

/// What is wrong with a quote; NULL: nothing. A stamp from before the channel was opened is another client's.
static const char *stale(const iw_host_t *self, const iw_host_client_t *client, const iwn_quote_t *quote) {
    uint64_t boot = 0;
    if (quote == NULL) {
        return "it quotes no start of the board: a command that moves begins with boot, seq and t_us, which "
               "iwheel-serial "
               "puts there";
    }
    for (unsigned i = 0; i < IWN_LINE_BOOT; i++) {
        const char digit = quote->boot[i];
        boot = boot << 4 | (uint64_t)((digit <= '9') ? digit - '0' : digit - 'a' + 10);
    }
    if (boot != self->place.boot) {
        return "it was meant for an earlier start of the board";
    }
    if (client->has_seq && quote->seq <= client->seq) {
        return "a command with this seq, or a later one, came before it";
    }
    if (quote->t_us > self->now_us || quote->t_us < client->opened_us || self->now_us - quote->t_us > self->lease_us) {
        return "it is older than lease_ms, or from before its channel was opened: the line or the host was held up";
    }
    return NULL;
}

/// A command that is refused before the core judges it: to the core one that is out of range, so that it is remembered
/// as one that nobody may arm into.
static void remember_wish(const iw_host_t *self, const iw_host_client_t *client, const iw_drive_t *wanted) {
    const iw_drive_t unknown = {.speed_mm_s = {INT32_MAX, INT32_MAX}};
    iw_applied_t applied;
    if (wanted->speed_mm_s[IW_LEFT] != 0 || wanted->speed_mm_s[IW_RIGHT] != 0) {
        (void)iw_gateway_drive(self->place.gateway, self->now_us, client->id, &unknown, &applied);
    }
}

/// The lease runs from the stamp: whoever held the line up, the wheels stop lease_ms after a time at which the command
/// did not exist yet.
static void drive(iw_host_t *self, iw_host_client_t *client, const iwn_quote_t *quote, const iw_drive_t *wanted) {
    iw_applied_t applied;
    const bool armed = iw_gateway_state(self->place.gateway) == IW_STATE_ARMED;
    if (armed && self->request.lease_key[0] != '\0') {
        remember_wish(self, client, wanted);
        REFUSE(self, client, IWN_NOT_HOLDER, "this gateway is a microcontroller, which gives no key; leave key out");
        return;
    }
    const char *const why = armed ? stale(self, client, quote) : NULL; // Else the core refuses it, whatever it quotes.
    if (why != NULL) {
        remember_wish(self, client, wanted);
        REFUSE(self, client, IWN_STALE_COMMAND, "this command feeds nothing: ", why);
        return;
    }
    if (armed) {
        client->has_seq = true;
        client->seq = quote->seq;
    }
    const iw_time_us_t sent_us = armed ? quote->t_us : self->now_us;
    const iw_refusal_t refusal = iw_gateway_drive(self->place.gateway, sent_us, client->id, wanted, &applied);
    if (refusal != IW_REFUSE_NONE) {
        iw_answer_refuse(self, client, refusal);
        return;
    }
    iwn_out_t json = iw_host_begin_reply(self, &self->request.id);
    iwn_tell_applied(&applied, &json);
    iw_host_send_reply(self, client, &json);
}

/// A number too large for the core is too large for the wheels: the core refuses it by its range.
static int32_t saturate(int64_t value) {
    return (value > INT32_MAX) ? INT32_MAX : (value < INT32_MIN) ? INT32_MIN : (int32_t)value;
}

static void do_drive(iw_host_t *self, iw_host_client_t *client, const iwn_quote_t *quote) {
    const iwn_request_t *const request = &self->request;
    const iw_drive_t wanted = {
        .speed_mm_s = {saturate(request->left_mm_s), saturate(request->right_mm_s)},
        .current_mA = {saturate(request->left_mA), saturate(request->right_mA)},
        .has_current = request->has_current,
    };
    drive(self, client, quote, &wanted);
}

/// A turn for which no speeds are known.
static void refuse_turn(iw_host_t *self, iw_host_client_t *client) {
    const iw_drive_t turn = {.speed_mm_s = {-1, 1}};
    remember_wish(self, client, &turn);
    REFUSE(self, client, IWN_DENIED,
           "the distance between the wheels is not that of wheels.track_mm, so a turn has no speeds; correct it by the "
           "request config, "
           "or drive without yaw_mrad_s");
}

static void do_twist(iw_host_t *self, iw_host_client_t *client, const iwn_quote_t *quote) {
    const int64_t limit = 1000000; // Far outside, and no product of it overflows.
    const int64_t v = self->request.v_mm_s;
    const int64_t yaw = self->request.yaw_mrad_s;
    if (yaw != 0 && iw_host_look(self)->assumed[IW_LEDGER_TRACK].state == IW_LEDGER_CONTRADICTED) {
        refuse_turn(self, client);
        return;
    }
    const int64_t v_mm_s = (v > limit) ? limit : (v < -limit) ? -limit : v;
    const int64_t yaw_mrad_s = (yaw > limit) ? limit : (yaw < -limit) ? -limit : yaw;
    const int64_t rim_mm_s = yaw_mrad_s * (int64_t)iw_host_look(self)->config->track_mm / 2000;
    const iw_drive_t wanted = {.speed_mm_s = {saturate(v_mm_s - rim_mm_s), saturate(v_mm_s + rim_mm_s)}};
    drive(self, client, quote, &wanted);
}

static void do_stop(iw_host_t *self, iw_host_client_t *client) {
    self->stopped_us = self->now_us;
    self->stopped_by = client->id;
    iw_gateway_stop(self->place.gateway, self->now_us, client->id, IW_CAUSE_CLIENT_STOP);
    reply_state(self, client);
}

static void do_estop(iw_host_t *self, iw_host_client_t *client) {
    const iw_snapshot_t *const seen = iw_host_look(self);
    const bool latched = seen->state == IW_STATE_LATCHED;
    self->estopped_us = self->now_us;
    self->estopped_by = client->id;
    if (!latched || self->now_us - seen->seen_us[IW_CAUSE_ESTOP_SOFTWARE] >= ESTOP_AGAIN_US) {
        if (!latched) {
            memcpy(self->estop_reason, self->request.reason, sizeof self->estop_reason);
        }
        iw_gateway_estop(self->place.gateway, self->now_us, client->id);
    }
    reply_state(self, client);
}

/// Of a request that only the core judges: reset or release.
static void reply_judged(iw_host_t *self, iw_host_client_t *client, iw_refusal_t refusal) {
    if (refusal != IW_REFUSE_NONE) {
        iw_answer_refuse(self, client, refusal);
        return;
    }
    reply_state(self, client);
}

static void do_tare(iw_host_t *self, iw_host_client_t *client) {
    const iw_snapshot_t *const seen = iw_host_look(self);
    const iw_force_t before[IW_SIDES] = {*seen->wheel[IW_LEFT].force, *seen->wheel[IW_RIGHT].force};
    const iw_force_quality_t quality[IW_SIDES] = {iw_force_measure(&before[IW_LEFT]),
                                                  iw_force_measure(&before[IW_RIGHT])};
    const uint8_t sides = self->request.sides;
    iw_side_t refused = IW_LEFT;
    const iw_tare_t result = iw_gateway_tare(self->place.gateway, self->now_us, sides, &refused);
    if (result != IW_TARE_OK) {
        iwn_refuse_describe_tare(refused, result, &self->refusal);
        send_refusal(self, client);
        return;
    }
    iwn_out_t json = iw_host_begin_reply(self, &self->request.id);
    iwn_out_text(&json, "state", iwn_state_name(seen->state));
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if ((sides & (1U << side)) != 0U) {
            self->zero[side] = iw_learnt_zero(seen->wheel[side].force, &quality[side]);
            iwn_out_open(&json, (side == IW_LEFT) ? "left" : "right", '{');
            iwn_tell_tare(seen->wheel[side].force, &quality[side], &before[side], &json);
            iwn_out_close(&json, '}');
        }
    }
    iw_host_send_reply(self, client, &json);
}

/// There is no disk for recordings, and no room for frames.
static void do_why(iw_host_t *self, iw_host_client_t *client) {
    iwn_out_t json = iw_host_begin_reply(self, &self->request.id);
    iwn_tell_stop(&self->stop, self->now_us, &json);
    iwn_out_null(&json, "directory");
    iwn_out_null(&json, "recording");
    iwn_out_null(&json, "recording_error");
    iwn_out_open(&json, "frames_before", '[');
    iwn_out_close(&json, ']');
    iwn_out_open(&json, "frames_after", '[');
    iwn_out_close(&json, ']');
    iw_host_send_reply(self, client, &json);
}

static bool may_watch(iwn_cmd_t cmd) {
    static const bool allowed[IWN_CMDS] = {
        [IWN_CMD_HELLO] = true, [IWN_CMD_STATUS] = true, [IWN_CMD_WATCH] = true, [IWN_CMD_WHY] = true,
        [IWN_CMD_STOP] = true,  [IWN_CMD_DISARM] = true, [IWN_CMD_ESTOP] = true,
    };
    return allowed[cmd];
}

/// What is asked for seldom.
static void carry_out_seldom(iw_host_t *self, iw_host_client_t *client) {
    switch (self->request.cmd) {
    case IWN_CMD_RESET:
        reply_judged(self, client, iw_gateway_reset(self->place.gateway, self->now_us));
        break;
    case IWN_CMD_RELEASE:
        reply_judged(self, client, iw_gateway_release(self->place.gateway));
        break;
    case IWN_CMD_TARE:
        do_tare(self, client);
        break;
    case IWN_CMD_CONFIRM:
        iw_answer_confirm(self, client);
        break;
    case IWN_CMD_CONFIG:
        iw_answer_config(self, client);
        break;
    default:
        REFUSE(self, client, IWN_DENIED, "this gateway is a microcontroller and has no recordings");
        break;
    }
}

/// No table of functions: the worst stack is found by following the calls.
static void carry_out(iw_host_t *self, iw_host_client_t *client, const iwn_quote_t *quote) {
    switch (self->request.cmd) {
    case IWN_CMD_HELLO:
        do_hello(self, client);
        break;
    case IWN_CMD_STATUS:
        do_status(self, client);
        break;
    case IWN_CMD_WATCH:
        do_watch(self, client);
        break;
    case IWN_CMD_ARM:
        do_arm(self, client);
        break;
    case IWN_CMD_DRIVE:
        do_drive(self, client, quote);
        break;
    case IWN_CMD_TWIST:
        do_twist(self, client, quote);
        break;
    case IWN_CMD_STOP:
    case IWN_CMD_DISARM:
        do_stop(self, client);
        break;
    case IWN_CMD_ESTOP:
        do_estop(self, client);
        break;
    case IWN_CMD_WHY:
        do_why(self, client);
        break;
    default:
        carry_out_seldom(self, client);
        break;
    }
}

/// By what the request says of its age and its stop.
static bool is_late(iw_host_t *self) {
    const iw_stop_t *const stop = iw_host_look(self)->stop;
    const iw_time_us_t asked_us = (self->stopped_us > self->estopped_us) ? self->stopped_us : self->estopped_us;
    const iwn_moment_t moment = {self->now_us, (stop->at_us > asked_us) ? stop->at_us : asked_us, stop->number,
                                 IWN_MAX_AGE_MS};
    return iwn_refuse_late(&self->request, &moment, &self->refusal);
}

void iw_answer(iw_host_t *self, iw_host_client_t *client, const iwn_quote_t *quote) {
    if (client->watches_only && !may_watch(self->request.cmd)) {
        REFUSE(self, client, IWN_DENIED, "this channel is for watching, stop and estop");
        return;
    }
    if (is_late(self)) {
        send_refusal(self, client);
        return;
    }
    carry_out(self, client, quote);
    iw_observe(self, iw_host_look(self));
}
