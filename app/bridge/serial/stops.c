// SPDX-License-Identifier: MIT
// Requests on the line, and the places of stop requests. A stop stays in its place until the board answers, whatever
// becomes of its client and its channel.
#include "relay.h"

#include "iwheel_northbound/json_out.h"

#define BAD_JSON      "not one JSON object on one line; its stop is executed"
#define NOT_CONFIRMED "the line is refused; its stop is sent to the board, which has not confirmed it yet"
#define LINE_TOO_LONG "a request has at most 4096 bytes and ends with a newline; its stop is executed"
IW_STATIC_ASSERT(IWN_LINE_MAX == 4096U, the_message_has_this_number);

size_t relay_write_numbered(iwn_json_t root, uint64_t number, char *out, size_t size) {
    iwn_text_t text = iwn_text_begin(out, size);
    iwn_json_t rest = iwn_json_inside(root);
    iwn_json_t name;
    iwn_json_t value;
    IWN_TEXT_JOIN(&text, "{\"id\":");
    iwn_text_int(&text, (int64_t)number);
    while (iwn_json_next(&rest, &name, &value)) {
        if (!iwn_json_is(name, "id")) {
            iwn_text_span(&text, ",", 1);
            iwn_text_span(&text, name.at, (size_t)(rest.at - name.at));
        }
    }
    IWN_TEXT_JOIN(&text, "}");
    return (text.length + 1U < size) ? text.length : 0U;
}

IW_STATIC_ASSERT(1U + 2U * IWN_REASON_MAX + 64U <= SERIAL_JSON_MAX, a_stop_with_the_longest_reason_fits_the_line);

/// Writes the request without its other fields: they may not fit, and an older board refuses unknown ones.
static void write_stop(relay_stop_t *stop, const iwn_request_t *asked) {
    serial_request_t *request = &stop->request;
    iwn_out_t out;
    stop->latches = asked->cmd == IWN_CMD_ESTOP;
    iwn_out_init(&out, request->json, sizeof request->json);
    iwn_out_open(&out, NULL, '{');
    iwn_out_int(&out, "id", (int64_t)request->number);
    iwn_out_text(&out, "cmd", stop->latches ? "estop" : "stop");
    if (asked->reason[0] != '\0') {
        iwn_out_text(&out, "reason", asked->reason);
    }
    iwn_out_close(&out, '}');
    request->length = iwn_out_finish(&out) - 1U; // Without its newline.
}

static const char *reason_of(const iwn_request_t *asked) {
    return (asked->refused == IWN_LINE_TOO_LONG) ? LINE_TOO_LONG : BAD_JSON;
}

/// Sets the refusal that replaces the reply of the board if the line of the stop is refused.
static void refuse_line(serial_request_t *request, const iwn_request_t *asked) {
    request->error = asked->refused;
    request->reason = reason_of(asked);
}

/// Returns a stop with the same effect that is not sent yet, or NULL. IW_CLIENT_NONE: of any client.
static relay_stop_t *equal_stop(relay_t *self, iw_client_t sender, bool latches) {
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        relay_stop_t *stop = &self->stop[i];
        if (stop->request.number != 0U && stop->request.state == SERIAL_WAITING && stop->latches == latches &&
            (sender == IW_CLIENT_NONE || stop->sender == sender)) {
            return stop;
        }
    }
    return NULL;
}

/// Returns a free place, otherwise that of the oldest stop that was sent. NULL: all of them wait.
static relay_stop_t *free_place(relay_t *self) {
    relay_stop_t *found = NULL;
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        relay_stop_t *stop = &self->stop[i];
        if (stop->request.number == 0U) {
            return stop;
        }
        if (stop->request.state != SERIAL_WAITING && (found == NULL || stop->request.number < found->request.number)) {
            found = stop;
        }
    }
    return found;
}

/// Frees the place. A client without a channel receives this reply; that of another is in its queue.
static void refuse_stop(relay_t *self, relay_stop_t *stop, iwn_error_t error, const char *reason) {
    sock_client_t *client = sock_clients_find(&self->clients, stop->sender);
    stop->request.number = 0;
    if (client != NULL && relay_channel_of(self, client) == NULL) {
        relay_refuse(self, client, &stop->request.id, error, reason);
        client->owed = false;
    }
}

/// A request of any client that came before a stop must not move the wheels after it.
static void overtake(relay_t *self, const sock_client_t *stopper) {
    sock_clients_note_stop(&self->clients, stopper); // For the requests in the sockets.
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        serial_queue_overtake(&self->channel[i].queue, SERIAL_STOPS);
    }
}

/// Stores a stop for the board. Returns its place, or that of an equal one that waits.
static relay_stop_t *put(relay_t *self, sock_client_t *client, const iwn_request_t *asked) {
    const bool latches = asked->cmd == IWN_CMD_ESTOP;
    const relay_channel_t *channel = relay_channel_of(self, client);
    relay_stop_t *stop = equal_stop(self, client->id, latches);
    overtake(self, client);
    if (stop != NULL) {
        return stop;
    }
    stop = free_place(self);
    if (stop == NULL) { // All others wait, and each stops the wheels too.
        stop = equal_stop(self, IW_CLIENT_NONE, latches);
        if (stop == NULL) {
            stop = &self->stop[0];
            if (latches) {
                write_stop(stop, asked);
            }
        }
        return stop;
    }
    if (stop->request.number != 0U) {
        refuse_stop(self, stop, IWN_INTERNAL, SERIAL_NO_REPLY);
    }
    stop->sender = client->id;
    stop->channel = (channel != NULL) ? (uint8_t)(channel - self->channel) : 0U;
    stop->ahead = false;
    stop->request =
        (serial_request_t){.kind = SERIAL_STOPS, .number = ++self->number, .id = asked->id, .came_us = self->now_us};
    refuse_line(&stop->request, asked);
    write_stop(stop, asked);
    client->owed = client->owed || channel == NULL; // It waits for the reply; that of a channel waits for its queue.
    return stop;
}

/// Returns the oldest stop of this kind that was sent ahead for the client; NULL if there is none.
static relay_stop_t *stop_ahead(relay_t *self, const sock_client_t *client, iwn_cmd_t cmd) {
    relay_stop_t *found = NULL;
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        relay_stop_t *stop = &self->stop[i];
        if (stop->request.number != 0U && stop->ahead && stop->sender == client->id &&
            stop->latches == (cmd == IWN_CMD_ESTOP) &&
            (found == NULL || stop->request.number < found->request.number)) {
            found = stop;
        }
    }
    return found;
}

void relay_stop_forward(relay_t *self, relay_channel_t *channel, sock_client_t *client, const iwn_request_t *asked) {
    relay_stop_t *stop = stop_ahead(self, client, asked->cmd);
    channel->ahead -= (channel->ahead > 0U) ? 1U : 0U;
    if (stop == NULL) {
        stop = put(self, client, asked);
    }
    stop->ahead = false;
    serial_request_t *place = serial_queue_place(&channel->queue);
    *place = stop->request;
    place->id = asked->id;
    refuse_line(place, asked);
    if (place->state == SERIAL_HELD) {
        stop->request.number = 0;
    } else {
        place->state = SERIAL_SENT;
        place->sent_us = self->now_us;
    }
    serial_queue_put(&channel->queue);
}

void relay_stop_last(relay_t *self, sock_client_t *client, const iwn_request_t *asked) {
    relay_stop_t *stop = stop_ahead(self, client, asked->cmd);
    if (self->link.state == SERIAL_SILENT) {
        relay_refuse(self, client, &asked->id, IWN_BUS_DOWN, RELAY_NOT_SENT);
        return;
    }
    if (stop != NULL) {
        stop->ahead = false; // Without an answer it continues; HELD: it is done.
    } else {
        (void)put(self, client, asked);
    }
    if (asked->refused != IWN_OK && relay_channel_of(self, client) != NULL) {
        relay_refuse(self, client, &asked->id, asked->refused, NOT_CONFIRMED);
    }
}

void relay_stops_read_ahead(relay_t *self, relay_channel_t *channel, sock_client_t *client) {
    const char *line;
    size_t at = 0;
    size_t length;
    unsigned stops = 0;
    while ((line = sock_client_next_stop(client, &at, &length)) != NULL) {
        iwn_request_t request;
        iwn_refusal_t refusal;
        if (iwn_request_read(line, length, &self->work, &request, &refusal) && iwn_cmd_stops(request.cmd) &&
            ++stops > channel->ahead) {
            channel->ahead = stops;
            put(self, client, &request)->ahead = true;
        }
    }
}

/// The client has its reply. If it was the last one, the client is closed.
static void settle(relay_t *self, sock_client_t *client) {
    client->owed = false;
    if (client->executed || client->phase == SOCK_ENDED) {
        sock_service_finish(&self->clients, client);
    }
}

void relay_stop_take(relay_t *self, const relay_reply_t *reply, bool passed) {
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        relay_stop_t *stop = &self->stop[i];
        if (reply->number == 0U || stop->request.number != reply->number || stop->request.state != SERIAL_SENT) {
            continue;
        }
        stop->request.ok = reply->ok;
        if (stop->ahead) {
            serial_request_hold(&stop->request, reply->rest, reply->length);
            return;
        }
        sock_client_t *client = passed ? NULL : sock_clients_find(&self->clients, stop->sender);
        stop->request.number = 0;
        if (client != NULL) {
            relay_pass_reply(self, client, &stop->request, reply->rest, reply->length);
            settle(self, client);
        }
        return;
    }
}

void relay_stops_refuse(relay_t *self) {
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        if (self->stop[i].request.number != 0U) {
            refuse_stop(self, &self->stop[i], IWN_BUS_DOWN, RELAY_NOT_SENT);
        }
    }
}

static bool is_unanswered(const relay_stop_t *stop) {
    return stop->request.number != 0U && stop->request.state < SERIAL_HELD;
}

void relay_stops_age(relay_t *self) {
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        relay_stop_t *stop = &self->stop[i];
        if (is_unanswered(stop) && self->now_us >= stop->request.came_us + SERIAL_PATIENCE_US) {
            refuse_stop(self, stop, IWN_INTERNAL, SERIAL_NO_REPLY);
        }
        if (stop->request.state == SERIAL_HELD && sock_clients_find(&self->clients, stop->sender) == NULL) {
            stop->request.number = 0;
        }
    }
}

bool relay_stops_wait(const relay_t *self, uint64_t since_us) {
    bool wait = false;
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        wait = wait || (is_unanswered(&self->stop[i]) && self->stop[i].request.came_us <= since_us);
    }
    return wait;
}

void relay_stops_report(relay_t *self) {
    unsigned count = 0;
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        count += is_unanswered(&self->stop[i]) ? 1U : 0U;
    }
    if (count > 0U) {
        sock_log(&self->log, SOCK_LOG_WARNING,
                 "%u stop%s no reply of the board, and the relay ends; check that the wheels stop, or press the e-stop",
                 count, (count == 1U) ? " has" : "s have");
    }
}

uint64_t relay_stops_next_us(const relay_t *self) {
    uint64_t next_us = UINT64_MAX;
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        const serial_request_t *request = &self->stop[i].request;
        if (is_unanswered(&self->stop[i]) && request->state == SERIAL_SENT &&
            request->tried_us + SERIAL_AGAIN_US < next_us) {
            next_us = request->tried_us + SERIAL_AGAIN_US;
        }
    }
    return next_us;
}

/// Returns the stop that is sent now, or NULL: new ones first.
static relay_stop_t *due_stop(relay_t *self) {
    relay_stop_t *found = NULL;
    for (unsigned i = 0; i < RELAY_STOPS; i++) {
        relay_stop_t *stop = &self->stop[i];
        const serial_request_t *request = &stop->request;
        const bool due = request->state == SERIAL_WAITING || self->now_us >= request->tried_us + SERIAL_AGAIN_US;
        if (is_unanswered(stop) && due &&
            (found == NULL || request->tried_us < found->request.tried_us ||
             (request->tried_us == found->request.tried_us && request->number < found->request.number))) {
            found = stop;
        }
    }
    return found;
}

/// Returns the sender's channel if the board serves it, otherwise any that it serves; 0: none. A repetition uses the
/// channel for stops first, because the board may have closed the others.
static uint8_t served_channel(const relay_t *self, const relay_stop_t *stop) {
    uint8_t found = self->channel[stop->channel].served ? stop->channel : 0U;
    for (uint8_t i = 1; i <= IWN_LINE_CHANNELS; i++) {
        const relay_channel_t *channel = &self->channel[i];
        const bool is_new = channel->state == RELAY_WELCOMED && channel->client == IW_CLIENT_NONE;
        if (channel->served && (found == 0U || (is_new && stop->request.state == SERIAL_SENT))) {
            found = i;
        }
    }
    return found;
}

/// The newline before the line ends an incomplete one that the board has received. Otherwise the stop would be a part of
/// that line, and only its repetition would be executed.
size_t relay_next_stop(relay_t *self, char *out, size_t size) {
    relay_stop_t *stop = due_stop(self);
    const uint8_t channel = (stop != NULL) ? served_channel(self, stop) : 0U;
    if (channel == 0U) {
        return 0;
    }
    serial_queue_sent(&stop->request, self->now_us);
    const iwn_line_t line = {.channel = channel, .json = stop->request.json, .length = stop->request.length};
    out[0] = '\n';
    const size_t length = iwn_line_write(&line, &out[1], size - 1U);
    return (length > 0U) ? 1U + length : 0U;
}
