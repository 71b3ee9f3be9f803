// SPDX-License-Identifier: MIT
#include "host.h"

#include "serial.h"

#include <string.h>

#define CHANNEL_LINK 0U

static void note_fault(iw_host_t *self, iwn_line_verdict_t fault) {
    self->errors++;
    self->fault = fault;
}

const iw_snapshot_t *iw_host_look(iw_host_t *self) {
    iw_gateway_snapshot(self->place.gateway, self->now_us, &self->seen);
    return &self->seen;
}

iw_host_client_t *iw_host_find(iw_host_t *self, iw_client_t id) {
    for (unsigned i = 0; i < IWN_LINE_CHANNELS && id != IW_CLIENT_NONE; i++) {
        if (self->client[i].id == id) {
            return &self->client[i];
        }
    }
    return NULL;
}

const char *iw_host_name(iw_host_t *self, iw_client_t id, unsigned text) {
    const iw_host_client_t *const client = iw_host_find(self, id);
    iwn_text_t out = iwn_text_begin(self->scratch.texts[text], sizeof self->scratch.texts[text]);
    const bool named = client != NULL && client->name[0] != '\0';
    IWN_TEXT_JOIN(&out, named ? "\"" : "", named ? client->name : "", named ? "\" (" : "", "client ");
    iwn_text_int(&out, id);
    IWN_TEXT_JOIN(&out, named ? ")" : (client == NULL) ? " (gone)" : "");
    return out.data;
}

iwn_surroundings_t iw_host_around(const iw_host_t *self, const iw_snapshot_t *seen) {
    const iw_host_place_t *const place = &self->place;
    iwn_surroundings_t around = {
        .wall_us = IWN_WALL_UNKNOWN,
        .version = place->version,
        .bus = {.name = place->bus,
                .timing = "confirmed", // Asserted when it was compiled.
                .bitrate_hz = place->bitrate_hz,
                .sample_point_permille = place->sample_point_permille},
        .estop = {.line = place->estop, .answer = self->estop_high ? 1 : 0, .present = true},
    };
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const iw_learnt_zero_t *const zero = &self->zero[side];
        const bool measured = zero->from == IW_OFFSET_ESTIMATED || zero->from == IW_OFFSET_OPERATOR;
        around.zero[side] = (iwn_zero_note_t){.from = (iw_offset_provenance_t)zero->from,
                                              .samples = measured ? IW_FORCE_WINDOW_SAMPLES : 0U,
                                              .deviation_mN = zero->deviation_mN,
                                              .drift_mN = zero->drift_mN};
    }
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        const iw_host_client_t *const client = &self->client[i];
        around.clients += (client->id != IW_CLIENT_NONE) ? 1U : 0U;
        if (client->id != IW_CLIENT_NONE && client->id == seen->holder) {
            around.holder = (iwn_holder_t){.client = client->id, .name = client->name};
        }
    }
    return around;
}

/// What has come of its leaving is told while it is still known who it was.
static void end_client(iw_host_t *self, iw_host_client_t *client) {
    if (client->id != IW_CLIENT_NONE) {
        iw_gateway_disconnect(self->place.gateway, self->now_us, client->id);
        iw_observe(self, iw_host_look(self));
        const iw_client_t id = client->id;
        iw_pending_forget(&self->pending, id);
        memset(client, 0, sizeof *client);
    }
}

static void end_all(iw_host_t *self) {
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        end_client(self, &self->client[i]);
    }
}

static void open_client(iw_host_t *self, uint8_t channel, bool watches_only) {
    iw_host_client_t *const client = &self->client[channel - 1U];
    end_client(self, client); // Its close was lost.
    client->id = ++self->last_id;
    client->watches_only = watches_only;
    client->opened_us = self->now_us;
    client->rate_hz = IWN_RATE_DEFAULT_HZ;
    const iwn_hello_t hello = {.version = self->place.version,
                               .bus = self->place.bus,
                               .state = iw_gateway_state(self->place.gateway),
                               .client = client->id,
                               .watches_only = watches_only};
    iwn_out_t json = iw_host_begin_event(self, "hello");
    iwn_tell_hello(&hello, &json);
    iwn_out_int(&json, "t_us", (int64_t)self->now_us);
    iw_host_send_reply(self, client, &json); // What it waits for before it says anything: not to be dropped.
}

/// True with the channel of a client in `*out_channel`.
static bool find_channel(iwn_json_t root, uint8_t *out_channel) {
    iwn_json_t value;
    if (!iwn_json_find(root, "channel", &value) || iwn_json_kind(value) != IWN_JSON_INTEGER) {
        return false;
    }
    const int64_t channel = iwn_json_integer(value);
    *out_channel = (uint8_t)channel;
    return channel >= 1 && channel <= (int64_t)IWN_LINE_CHANNELS;
}

/// A command of the relay's. False: it is none.
static bool obey_link(iw_host_t *self, iwn_json_t root) {
    uint8_t channel = 0;
    iwn_json_t cmd;
    iwn_json_t watch;
    if (!iwn_json_find(root, "cmd", &cmd)) {
        return false;
    }
    if (iwn_json_is(cmd, "alive")) {
        return true;
    }
    if (iwn_json_is(cmd, "link")) {
        end_all(self); // Another relay, or the same one begun anew: its clients are not those of before.
        iw_host_tell_link(self);
        return true;
    }
    if (!find_channel(root, &channel)) {
        return false;
    }
    if (iwn_json_is(cmd, "close")) {
        end_client(self, &self->client[channel - 1U]);
        return true;
    }
    if (iwn_json_is(cmd, "open") && iwn_json_find(root, "watch", &watch)) {
        open_client(self, channel, iwn_json_kind(watch) != IWN_JSON_FALSE);
        return true;
    }
    return false;
}

static bool read_object(iw_host_t *self, const char *json, size_t length, iwn_json_t *out_root) {
    char why[1];
    iwn_text_t fault = iwn_text_begin(why, sizeof why);
    return iwn_json_check(json, length, &self->scratch.work, out_root, &fault) &&
           iwn_json_kind(*out_root) == IWN_JSON_OBJECT;
}

/// A reply or an event: an answer to it could be answered, and so on for ever.
static bool is_answer(iw_host_t *self, const char *json, size_t length) {
    iwn_json_t root;
    iwn_json_t value;
    return read_object(self, json, length, &root) &&
           (iwn_json_find(root, "ok", &value) || iwn_json_find(root, "event", &value));
}

static bool take_link(iw_host_t *self, const iwn_line_t *line) {
    iwn_json_t root;
    return (read_object(self, line->json, line->length, &root) && obey_link(self, root)) ||
           is_answer(self, line->json, line->length);
}

static bool take_request(iw_host_t *self, const iwn_line_t *line) {
    iw_host_client_t *const client = &self->client[line->channel - 1U];
    if (client->id == IW_CLIENT_NONE) {
        return false;
    }
    char *json = &self->in[line->json - self->in];
    size_t length = line->length;
    iwn_quote_t quote;
    const bool quoted = iwn_quote_take(&json, &length, &quote);
    if (iwn_request_read(json, length, &self->scratch.work, &self->request, &self->refusal)) {
        iw_answer(self, client, quoted ? &quote : NULL);
    } else if (!is_answer(self, json, length)) {
        iw_host_send_refusal(self, client, &self->request.id);
    }
    return true;
}

static void take_line(iw_host_t *self, const iwn_line_t *line) {
    self->heard_us = self->now_us;
    const bool good = (line->channel == CHANNEL_LINK) ? take_link(self, line) : take_request(self, line);
    if (!good) {
        note_fault(self, IWN_LINE_MISFORMED);
    }
}

/// Before the wheels are heard: what this run measures comes on top.
static void recall(iw_host_t *self) {
    iw_learnt_t learnt;
    if (iw_host_recall(&learnt)) {
        iw_learnt_restore(&learnt, &self->place.settings, self->place.gateway, self->zero);
        self->memory = IW_MEMORY_KEPT;
    }
}

bool iw_host_is_silent(const iw_host_t *self) {
    return iw_gateway_state(self->place.gateway) == IW_STATE_LISTENING && !iw_gateway_is_sending(self->place.gateway) &&
           !iw_gateway_arming(self->place.gateway);
}

/// Looks now and then, in the silence, whether there is anything that flash has not.
static void learn(iw_host_t *self, const iw_snapshot_t *seen) {
    iw_learnt_t now;
    iw_learnt_t kept;
    if (!iw_host_is_silent(self) || self->learn_us == 0U || self->restart_us != 0U) {
        self->learn_us = seen->at_us + IW_LEARNT_SILENT_US;
        return;
    }
    if (seen->at_us < self->learn_us) {
        return;
    }
    self->learn_us = seen->at_us + IW_LEARNT_SILENT_US;
    memset(&kept, 0, sizeof kept);
    (void)iw_host_recall(&kept);
    iw_learnt_note(&now, seen, &self->place.settings, self->zero);
    if (iw_learnt_differs(&now, &kept)) {
        self->memory = iw_host_remember(&now) ? IW_MEMORY_KEPT : IW_MEMORY_FAILED;
    }
}

void iw_host_init(iw_host_t *self, const iw_host_place_t *place, iw_time_us_t now_us) {
    self->place = *place;
    self->now_us = now_us;
    self->heard_us = now_us;
    self->linked_us = now_us;
    iw_config_t config;
    iw_settings_to(&place->settings, &config);
    self->lease_us = config.lease_ms * IW_US_PER_MS;
    self->staged = place->settings;
    iwn_receiver_init(&self->receiver, self->in, sizeof self->in, false);
    iwn_why_sentence(&self->stop.stop, &(iwn_why_context_t){0}, self->stop.sentence, sizeof self->stop.sentence);
    recall(self);
    iw_host_tell_link(self);
}

bool iw_host_wants_restart(const iw_host_t *self) {
    return self->restart_us != 0U && (iw_serial_is_idle() || self->now_us >= self->restart_us);
}

bool iw_host_take(iw_host_t *self, iw_time_us_t now_us) {
    char byte;
    unsigned lines = 0;
    self->now_us = now_us;
    if (now_us - self->heard_us >= (iw_time_us_t)IWN_LINE_SILENT_MS * IW_US_PER_MS) {
        end_all(self);
    }
    if (iw_serial_had_error()) {
        iwn_receiver_spoil(&self->receiver);
    }
    while (lines < IW_HOST_LINES_AT_ONCE && iw_serial_read(&byte, 1U) == 1U) {
        iwn_line_t line;
        const iwn_line_verdict_t verdict = iwn_receiver_put(&self->receiver, byte, &line);
        if (verdict == IWN_LINE_GOOD) {
            take_line(self, &line);
            lines++;
        } else if (verdict != IWN_LINE_NOTHING) {
            note_fault(self, verdict);
        }
    }
    return lines == IW_HOST_LINES_AT_ONCE;
}

static void settle_arms(iw_host_t *self, const iw_snapshot_t *seen) {
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        iw_host_client_t *const client = &self->client[i];
        if (client->id != IW_CLIENT_NONE && client->arming && !(seen->holder == client->id && seen->arming)) {
            client->arming = false;
            iw_answer_arming(self, client, seen);
        }
    }
}

static void tell_force(iw_host_t *self, iw_host_client_t *client, const iw_snapshot_t *seen) {
    const iwn_surroundings_t around = iw_host_around(self, seen);
    iwn_out_t json = iw_host_begin_event(self, "force");
    iwn_tell_force(seen, &around, &json);
    iw_host_send_event_to(self, client, &json);
}

static void tell_periodic(iw_host_t *self, iw_host_client_t *client, const iw_snapshot_t *seen) {
    if (self->now_us < client->next_us ||
        (client->topics & ((1U << IWN_TOPIC_STATE) | (1U << IWN_TOPIC_FORCE))) == 0U) {
        return;
    }
    const uint32_t period_us = 1000000U / client->rate_hz;
    client->next_us += period_us;
    if (client->next_us <= self->now_us) {
        client->next_us = self->now_us + period_us; // After a stall: no burst.
    }
    if ((client->topics & (1U << IWN_TOPIC_STATE)) != 0U) {
        client->lost += client->owed_state ? 1U : 0U;
        client->owed_state = true;
    }
    if ((client->topics & (1U << IWN_TOPIC_FORCE)) != 0U) {
        tell_force(self, client, seen);
    }
}

/// One snapshot at a time, replies first, each client in its turn.
static void pay(iw_host_t *self, const iw_snapshot_t *seen) {
    for (unsigned turn = 0; turn < 2U * IWN_LINE_CHANNELS && !iw_serial_lends(); turn++) {
        const bool reply = turn < IWN_LINE_CHANNELS;
        iw_host_client_t *const client = &self->client[(self->next_owed + turn) % IWN_LINE_CHANNELS];
        bool *const owed = reply ? &client->owed_status : &client->owed_state;
        if (client->id != IW_CLIENT_NONE && *owed) {
            *owed = false;
            const iwn_id_t *const id = reply ? iw_pending_take(&self->pending, client->id, IWN_CMD_STATUS) : NULL;
            iw_host_send_status(self, client, seen, id);
            self->next_owed = (uint8_t)(client - self->client + 1);
            return;
        }
    }
}

iw_time_us_t iw_host_tell(iw_host_t *self, const iw_snapshot_t *seen, bool estop_high) {
    self->now_us = seen->at_us;
    self->estop_high = estop_high;
    settle_arms(self, seen);
    iw_observe(self, seen);
    iw_time_us_t next_us = self->linked_us + IW_HOST_LINK_US;
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        iw_host_client_t *const client = &self->client[i];
        if (client->id == IW_CLIENT_NONE) {
            continue;
        }
        if (client->lost > 0U) {
            iw_host_tell_lost(self, client);
        }
        tell_periodic(self, client, seen);
        next_us = (client->topics != 0U && client->next_us < next_us) ? client->next_us : next_us;
    }
    pay(self, seen);
    iw_host_tell_fault(self);
    learn(self, seen);
    const bool armed = seen->state == IW_STATE_ARMED;
    if (self->now_us - self->linked_us >= IW_HOST_LINK_US ||
        (armed && self->now_us - self->stamped_us >= IW_HOST_LINK_ARMED_US)) {
        iw_host_tell_link(self);
    }
    return next_us;
}
