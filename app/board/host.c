// SPDX-License-Identifier: MIT
#include "host.h"

#include "serial.h"

#include <string.h>

#define CHANNEL_LINK 0U

static void note_fault(brd_host_t *self, iwn_line_verdict_t fault) {
    self->errors++;
    self->fault = fault;
}

void brd_host_observe(brd_host_t *self, const iw_snapshot_t *seen) {
    iwn_server_observe(&self->server, seen);
    brd_host_report_assumptions(self, seen);
}

/// Reports the effects of the disconnection while the server still knows the client's name.
static void end_client(brd_host_t *self, brd_host_client_t *client) {
    if (client->served.id != IW_CLIENT_NONE) {
        iw_gateway_disconnect(self->server.core, self->server.now_us, client->served.id);
        brd_host_observe(self, iwn_server_snapshot(&self->server));
        brd_pending_forget(&self->pending, client->served.id);
        memset(client, 0, sizeof *client);
    }
}

static void end_all(brd_host_t *self) {
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        end_client(self, &self->client[i]);
    }
}

static void open_client(brd_host_t *self, uint8_t channel, bool watches_only) {
    brd_host_client_t *const client = &self->client[channel - 1U];
    end_client(self, client); // The close of the former client was lost.
    client->opened_us = self->server.now_us;
    iwn_server_welcome(&client->served, ++self->last_id, watches_only);
    iwn_server_hello(&self->server, &client->served);
}

/// Returns true, with the channel of a client in `*out_channel`, if the object has one.
static bool find_channel(iwn_json_t root, uint8_t *out_channel) {
    iwn_json_t value;
    if (!iwn_json_find(root, "channel", &value) || iwn_json_kind(value) != IWN_JSON_INTEGER) {
        return false;
    }
    const int64_t channel = iwn_json_integer(value);
    *out_channel = (uint8_t)channel;
    return channel >= 1 && channel <= (int64_t)IWN_LINE_CHANNELS;
}

/// Executes a command of the relay. Returns false if the object is no such command.
static bool obey_link(brd_host_t *self, iwn_json_t root) {
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
        end_all(self); // Another relay, or the same one after a restart, has other clients.
        brd_host_report_link(self);
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

static bool read_object(brd_host_t *self, const char *json, size_t length, iwn_json_t *out_root) {
    char why[1];
    iwn_text_t fault = iwn_text_begin(why, sizeof why);
    return iwn_json_check(json, length, &self->scratch.work, out_root, &fault) &&
           iwn_json_kind(*out_root) == IWN_JSON_OBJECT;
}

/// Returns true for a reply or an event. The board does not answer these: the answer could be answered, without end.
static bool is_answer(brd_host_t *self, const char *json, size_t length) {
    iwn_json_t root;
    iwn_json_t value;
    return read_object(self, json, length, &root) &&
           (iwn_json_find(root, "ok", &value) || iwn_json_find(root, "event", &value));
}

static bool take_link(brd_host_t *self, const iwn_line_t *line) {
    iwn_json_t root;
    return (read_object(self, line->json, line->length, &root) && obey_link(self, root)) ||
           is_answer(self, line->json, line->length);
}

static bool take_request(brd_host_t *self, const iwn_line_t *line) {
    brd_host_client_t *const client = &self->client[line->channel - 1U];
    if (client->served.id == IW_CLIENT_NONE) {
        return false;
    }
    char *json = &self->in[line->json - self->in];
    size_t length = line->length;
    iwn_quote_t quote;
    const bool quoted = iwn_quote_take(&json, &length, &quote);
    if (iwn_request_read_short(json, length, &self->scratch.work, &self->server.request, &self->server.refusal)) {
        self->quote = quoted ? &quote : NULL;
        iwn_server_request(&self->server, &client->served);
        self->quote = NULL;
        brd_host_report_assumptions(self, iwn_server_snapshot(&self->server));
    } else if (!is_answer(self, json, length)) {
        iwn_server_refuse(&self->server, &client->served, &self->server.request.id);
    }
    return true;
}

static void take_line(brd_host_t *self, const iwn_line_t *line) {
    self->received_us = self->server.now_us;
    const bool good = (line->channel == CHANNEL_LINK) ? take_link(self, line) : take_request(self, line);
    if (!good) {
        note_fault(self, IWN_LINE_MISFORMED);
    }
}

/// Restores the learned facts before the wheels are online. The measurements of this run have priority.
static void restore_assumptions(brd_host_t *self) {
    brd_assumptions_t learned;
    if (brd_host_read_assumptions(&learned)) {
        brd_assumptions_restore(&learned, &self->settings, self->server.core, self->zero);
        self->records = BRD_RECORDS_STORED;
    }
}

bool brd_host_is_silent(const brd_host_t *self) {
    return iw_gateway_state(self->server.core) == IW_STATE_LISTENING && !iw_gateway_is_sending(self->server.core) &&
           !iw_gateway_arming(self->server.core);
}

bool brd_host_is_configured(brd_host_t *self) {
    iwn_refusal_t *const refusal = &self->server.refusal;
    iwn_text_t why = iwn_text_begin(refusal->message, sizeof refusal->message);
    refusal->error = IWN_DENIED;
    iwn_text_add(&why, "stored settings not in force: ");
    return brd_settings_check(&self->settings, &why);
}

/// While nothing is sent, checks periodically whether there are facts that the flash does not contain.
static void learn(brd_host_t *self, const iw_snapshot_t *seen) {
    brd_assumptions_t now;
    brd_assumptions_t stored;
    if (!brd_host_is_silent(self) || self->learn_us == 0U || self->restart_us != 0U) {
        self->learn_us = seen->at_us + BRD_ASSUMPTIONS_PERIOD_US;
        return;
    }
    if (seen->at_us < self->learn_us) {
        return;
    }
    self->learn_us = seen->at_us + BRD_ASSUMPTIONS_PERIOD_US;
    memset(&stored, 0, sizeof stored);
    (void)brd_host_read_assumptions(&stored);
    brd_assumptions_note(&now, seen, &self->settings, self->zero);
    // While the stored values are not in force, the observations are not about them.
    if (brd_assumptions_differs(&now, &stored) && brd_host_is_configured(self)) {
        self->records = brd_host_write_assumptions(&now) ? BRD_RECORDS_STORED : BRD_RECORDS_FAILED;
    }
}

void brd_host_init(brd_host_t *self, const brd_host_place_t *place, iw_time_us_t now_us) {
    iwn_server_t *const server = &self->server;
    server->core = place->gateway;
    server->version = place->version;
    server->bus = place->bus;
    server->max_age_ms = IWN_MAX_AGE_MS;
    server->rate_max_hz = place->rate_max_hz;
    server->topics =
        (uint8_t)((1U << IWN_TOPICS) - 1U) & (uint8_t) ~(1U << IWN_TOPIC_FRAME); // The line is too slow for it.
    server->each_for_itself = true;
    server->now_us = now_us;
    server->estop.line = place->estop;
    server->estop.present = true;
    self->bitrate_hz = place->bitrate_hz;
    self->sample_point_permille = place->sample_point_permille;
    self->boot = place->boot;
    self->last_fault = place->last_fault;
    self->received_us = now_us;
    self->linked_us = now_us;
    self->settings = place->settings;
    self->staged = place->settings;
    iwn_receiver_init(&self->receiver, self->in, sizeof self->in, false);
    iwn_server_begin(server);
    restore_assumptions(self);
    brd_host_report_link(self);
    self->lease_us = iwn_server_snapshot(server)->config->lease_ms * IW_US_PER_MS;
}

bool brd_host_wants_restart(brd_host_t *self) {
    const iw_time_us_t now_us = self->server.now_us;
    if (!brd_serial_is_idle()) {
        self->unsent_us = now_us;
    }
    return self->restart_us != 0U && brd_host_is_silent(self) &&
           (now_us - self->unsent_us >= BRD_HOST_LAST_BYTES_US || now_us >= self->restart_us);
}

bool brd_host_receive(brd_host_t *self, iw_time_us_t now_us) {
    char byte;
    self->server.now_us = now_us;
    if (now_us - self->received_us >= (iw_time_us_t)IWN_LINE_SILENT_MS * IW_US_PER_MS) {
        end_all(self);
    }
    if (brd_serial_had_error()) {
        iwn_receiver_spoil(&self->receiver);
    }
    while (brd_serial_read(&byte, 1U) == 1U) {
        iwn_line_t line;
        const iwn_line_verdict_t verdict = iwn_receiver_put(&self->receiver, byte, &line);
        if (verdict == IWN_LINE_GOOD) {
            take_line(self, &line);
            return true;
        }
        if (verdict != IWN_LINE_NOTHING) {
            note_fault(self, verdict);
        }
    }
    return false;
}

/// Sends one snapshot at a time: replies first, the clients in turn.
static void pay(brd_host_t *self, const iw_snapshot_t *seen) {
    for (unsigned turn = 0; turn < 2U * IWN_LINE_CHANNELS && !brd_serial_lends(); turn++) {
        const bool reply = turn < IWN_LINE_CHANNELS;
        brd_host_client_t *const client = &self->client[(self->next_owed + turn) % IWN_LINE_CHANNELS];
        bool *const owed = reply ? &client->owed_status : &client->owed_state;
        if ((client->served.topics & (1U << IWN_TOPIC_STATE)) == 0U) {
            client->owed_state = false; // It has ended its subscription.
        }
        if (client->served.id != IW_CLIENT_NONE && *owed) {
            *owed = false;
            const iwn_id_t *const id =
                reply ? brd_pending_take(&self->pending, client->served.id, IWN_CMD_STATUS) : NULL;
            brd_host_send_status(self, client, seen, id);
            self->next_owed = (uint8_t)(client - self->client + 1);
            return;
        }
    }
}

iw_time_us_t brd_host_report(brd_host_t *self, const iw_snapshot_t *seen, bool estop_high) {
    iwn_server_t *const server = &self->server;
    server->now_us = seen->at_us;
    server->estop.answer = estop_high ? 1 : 0;
    brd_host_observe(self, seen);
    iwn_server_arming(server, seen);
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        if (self->client[i].lost > 0U) {
            brd_host_report_lost(self, &self->client[i]);
        }
    }
    iwn_server_periodic(server);
    pay(self, seen);
    brd_host_report_fault(self);
    learn(self, seen);
    const bool armed = seen->state == IW_STATE_ARMED;
    if (server->now_us - self->linked_us >= BRD_HOST_LINK_US ||
        (armed && server->now_us - self->stamped_us >= BRD_HOST_LINK_ARMED_US)) {
        brd_host_report_link(self);
    }
    const iw_time_us_t next_us = iwn_server_next_us(server);
    const iw_time_us_t link_us = self->linked_us + BRD_HOST_LINK_US;
    return (next_us < link_us) ? next_us : link_us;
}
