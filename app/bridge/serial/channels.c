// SPDX-License-Identifier: MIT
#include "relay.h"

#include "iwheel_northbound/contents.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

relay_channel_t *relay_channel_of(relay_t *self, const sock_client_t *client) {
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        if (self->channel[i].client == client->id) {
            return &self->channel[i];
        }
    }
    return NULL;
}

/// Ends the use of a channel by its client; the board is informed.
static void release(relay_channel_t *channel) {
    channel->state = RELAY_FREE;
    channel->client = IW_CLIENT_NONE;
    channel->close_due = true;
    channel->queue.count = 0;
}

/// Returns the channel without a client that was unused for longest, so that replies on the way reach no other client.
static relay_channel_t *free_channel(relay_t *self) {
    relay_channel_t *found = NULL;
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        relay_channel_t *channel = &self->channel[i];
        if (channel->client == IW_CLIENT_NONE && (found == NULL || channel->used_us < found->used_us)) {
            found = channel;
        }
    }
    return found;
}

void relay_refuse(relay_t *self, sock_client_t *client, const iwn_id_t *id, iwn_error_t error, const char *reason) {
    iwn_refusal_t refusal;
    (void)IWN_REFUSE(&refusal, error, reason);
    sock_clients_refuse(&self->clients, client, id, &refusal);
}

static void turn_away(relay_t *self, sock_client_t *client, const char *why) {
    sock_log(&self->log, SOCK_LOG_INFO, "client %u (pid %d) is closed: %s", (unsigned)client->id, client->pid, why);
    iwn_refusal_t refusal;
    (void)IWN_REFUSE(&refusal, IWN_BUS_DOWN, "no board on the serial line: ", why);
    sock_clients_refuse(&self->clients, client, &(iwn_id_t){.kind = IWN_ID_NONE}, &refusal);
    sock_service_finish(&self->clients, client);
}

/// Returns the time after which the answer to a `drive` is lost: a line of the largest size may precede it.
static uint64_t hold_us(const relay_t *self) {
    return 30000U + (uint64_t)4608U * 10U * 1000000U / self->settings->board.baud;
}

static void begin(const relay_t *self, relay_channel_t *channel, iw_client_t client, bool watch) {
    *channel = (relay_channel_t){.state = RELAY_NEW,
                                 .client = client,
                                 .watch = watch,
                                 .close_due = channel->close_due,
                                 .served = channel->served,
                                 .since_us = self->now_us,
                                 .used_us = self->now_us};
    serial_queue_init(&channel->queue, hold_us(self));
}

static void welcome(void *context, sock_client_t *client) {
    relay_t *self = (relay_t *)context;
    if (client->right == SOCK_STOP) {
        return; // It has no channel.
    }
    relay_channel_t *channel = free_channel(self);
    if (self->link.state == SERIAL_SILENT || channel == NULL) {
        turn_away(self, client, (self->trouble[0] != '\0') ? self->trouble : "it has not answered yet; try again");
        return;
    }
    begin(self, channel, client->id, client->right == SOCK_WATCH);
}

/// Called once or more often: a client that is gone holds no lease. A client that only reads still receives its
/// replies.
static void leave(void *context, sock_client_t *client) {
    relay_channel_t *channel = relay_channel_of((relay_t *)context, client);
    if (channel != NULL && channel->granted) {
        release(channel);
        client->owed = false; // Its queue is gone.
    }
}

/// Queues a refusal in the order of the replies.
static void answer_here(relay_channel_t *channel, const iwn_id_t *id, iwn_error_t error, const char *message) {
    serial_request_t *place = serial_queue_place(&channel->queue);
    *place = (serial_request_t){.state = SERIAL_ANSWERED, .id = *id, .error = error};
    iwn_text_t text = iwn_text_begin(place->json, sizeof place->json);
    IWN_TEXT_JOIN(&text, message);
    place->reason = place->json;
    serial_queue_put(&channel->queue);
}

/// Writes the quote of a command before its other fields. Returns the length; 0 also if there was no stamp at that
/// time.
static size_t write_quoted(relay_t *self, const serial_request_t *request, size_t length, char *json) {
    iwn_quote_t quote = {.seq = request->number};
    char plain[SERIAL_JSON_MAX];
    if (length == 0U || !serial_link_stamp(&self->link, request->came_us, &quote.t_us)) {
        return 0;
    }
    memcpy(quote.boot, self->link.boot, sizeof quote.boot);
    memcpy(plain, json, length);
    return iwn_quote_write(&quote, plain, length, json, SERIAL_JSON_MAX);
}

/// Returns the reason why a request from that time is no longer sent; NULL if it is sent.
static const char *too_late(const relay_t *self, const relay_channel_t *channel, const sock_client_t *client,
                            serial_kind_t kind, uint64_t came_us) {
    if (kind != SERIAL_MOVES && kind != SERIAL_GRANTS) {
        return NULL;
    }
    if (channel->ahead > 0U || (kind == SERIAL_GRANTS && sock_client_waited_through_stop(client))) {
        return SERIAL_OVERTAKEN;
    }
    if (came_us < self->gap_us) {
        return "the relay was delayed while this request waited, so it was not sent; send it again";
    }
    if (kind == SERIAL_MOVES && came_us < channel->armed_us) {
        return "this command was sent before the reply to arm; wait for that reply, then send a new command";
    }
    if (kind == SERIAL_MOVES && self->now_us - came_us >= SERIAL_FRESH_US) {
        return "this command waited too long behind earlier ones; send no faster than the replies come";
    }
    return NULL;
}

static void forward(relay_t *self, relay_channel_t *channel, const sock_client_t *client, const iwn_request_t *asked,
                    iwn_json_t root) {
    const uint64_t since_us = (self->gap_us > channel->armed_us) ? self->gap_us : channel->armed_us;
    const uint64_t came_us = sock_client_sent_us(client, self->now_us, since_us);
    serial_request_t *place = serial_queue_place(&channel->queue);
    *place = (serial_request_t){.kind = serial_kind_of(asked->cmd), .id = asked->id, .came_us = came_us};
    const char *late = too_late(self, channel, client, place->kind, came_us);
    if (late != NULL) {
        answer_here(channel, &asked->id, IWN_STALE_COMMAND, late);
        return;
    }
    place->number = ++self->number;
    place->undated = serial_has_age(asked->cmd) && !asked->has_t_us;
    place->length = relay_write_numbered(root, place->number, place->json,
                                         SERIAL_JSON_MAX - (place->undated ? SERIAL_DATE_MAX : 0U));
    if (place->kind == SERIAL_MOVES) {
        place->length = write_quoted(self, place, place->length, place->json);
    }
    if (place->length == 0U) {
        answer_here(channel, &asked->id, IWN_LINE_TOO_LONG,
                    "over this serial line a request has at most 380 bytes; shorten its texts");
        return;
    }
    channel->granted = channel->granted || place->kind == SERIAL_GRANTS;
    if (asked->cmd == IWN_CMD_ARM) {
        channel->arm_number = place->number;
    }
    serial_queue_put(&channel->queue);
}

static void carry_out(void *context, sock_client_t *client, const char *line, size_t length) {
    relay_t *self = (relay_t *)context;
    relay_channel_t *channel = relay_channel_of(self, client);
    const bool last = channel == NULL || sock_client_is_closing(client);
    iwn_request_t request;
    iwn_refusal_t refusal;
    const bool right = iwn_request_read(line, length, &self->work, &request, &refusal);
    const bool stops = right && iwn_cmd_stops(request.cmd);
    if (last && stops) {
        relay_stop_last(self, client, &request);
    } else if (last && client->right == SOCK_STOP) {
        sock_service_refuse_crowd(&self->clients, client, &refusal);
        sock_clients_refuse(&self->clients, client, &request.id, &refusal);
    }
    if (last) {
        return;
    }
    if (!right) {
        answer_here(channel, &request.id, refusal.error, refusal.message);
    } else if (stops) {
        relay_stop_forward(self, channel, client, &request);
    } else if (channel->watch && !iwn_cmd_watches(request.cmd)) {
        answer_here(
            channel, &request.id, IWN_DENIED,
            "this socket is for watching; to drive connect to [northbound] socket of iwheel-serial, as a member "
            "of its group");
    } else {
        forward(self, channel, client, &request, iwn_json_root(line));
    }
    client->held = serial_queue_is_full(&channel->queue); // The next line stays in the socket.
}

sock_handler_t relay_handler(relay_t *self) {
    return (sock_handler_t){.welcome = welcome, .carry_out = carry_out, .leave = leave, .context = self};
}

void relay_pass_reply(relay_t *self, sock_client_t *client, const serial_request_t *request, const char *rest,
                      size_t length) {
    if (request->ok && request->error != IWN_OK) {
        relay_refuse(self, client, &request->id, request->error, request->reason);
        return;
    }
    iwn_out_t json = iwn_write_reply(self->clients.line, sizeof self->clients.line, &request->id, request->ok);
    if (length + 1U < json.size - json.length) {
        memcpy(&json.data[json.length], rest, length);
        json.data[json.length + length] = '\n';
        sock_client_reply(client, json.data, json.length + length + 1U);
    }
}

static void report_answered(relay_t *self, relay_channel_t *channel, sock_client_t *client) {
    const serial_request_t *request;
    while ((request = serial_queue_answered(&channel->queue)) != NULL) {
        if (request->state == SERIAL_HELD) {
            relay_pass_reply(self, client, request, request->json, request->length);
        } else {
            relay_refuse(self, client, &request->id, request->error, request->reason);
        }
        serial_queue_drop(&channel->queue);
    }
}

/// Advances `*at` if the text there is `words`.
static bool skip(const char **at, const char *end, const char *words) {
    const size_t length = strlen(words);
    const bool there = (size_t)(end - *at) >= length && memcmp(*at, words, length) == 0;
    *at += there ? length : 0U;
    return there;
}

/// Reads `{"id":17,"ok":true`: the number and the result. `*at` is then after it.
static bool read_reply(const char **at, const char *end, uint64_t *out_number, bool *out_ok) {
    *out_number = 0;
    if (!skip(at, end, "{\"id\":")) {
        return false;
    }
    while (*at < end && **at >= '0' && **at <= '9') {
        *out_number = *out_number * 10U + (uint64_t)(**at - '0');
        (*at)++;
    }
    *out_ok = skip(at, end, ",\"ok\":true");
    return *out_ok || skip(at, end, ",\"ok\":false");
}

/// Passes the reply to this client if it waits for it. Equal stops of a client have one number.
static bool give(relay_t *self, relay_channel_t *channel, sock_client_t *client, const relay_reply_t *reply) {
    bool given = false;
    while (serial_queue_take(&channel->queue, reply->number, reply->ok, reply->rest, reply->length)) {
        const serial_request_t *oldest = &channel->queue.ring[channel->queue.first];
        given = true;
        if (reply->number == channel->arm_number) {
            channel->armed_us = self->now_us;
        }
        if (oldest->number == reply->number && oldest->state == SERIAL_SENT) {
            relay_pass_reply(self, client, oldest, reply->rest, reply->length);
            serial_queue_drop(&channel->queue);
        }
    }
    report_answered(self, channel, client);
    return given;
}

/// A stop may have used the channel of another client.
static void take_reply(relay_t *self, const iwn_line_t *line) {
    const char *end = &line->json[line->length];
    relay_reply_t reply = {.rest = line->json};
    bool given = false;
    if (!read_reply(&reply.rest, end, &reply.number, &reply.ok)) {
        return;
    }
    reply.length = (size_t)(end - reply.rest);
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        sock_client_t *client = sock_clients_find(&self->clients, self->channel[i].client);
        given = (client != NULL && give(self, &self->channel[i], client, &reply)) || given;
    }
    relay_stop_take(self, &reply, given);
}

static bool begins(const iwn_line_t *line, const char *words) {
    const char *at = line->json;
    return skip(&at, &line->json[line->length], words);
}

void relay_take_line(relay_t *self, const iwn_line_t *line) {
    relay_channel_t *channel = &self->channel[line->channel];
    sock_client_t *client = sock_clients_find(&self->clients, channel->client);
    const bool hello = begins(line, "{\"event\":\"hello\"");
    if (begins(line, "{\"id\":")) {
        take_reply(self, line);
        return;
    }
    if (channel->state < (hello ? RELAY_OPENING : RELAY_WELCOMED) || line->length + 1U > sizeof self->clients.line) {
        return; // The event is for the former client of this channel.
    }
    const bool first = hello && channel->state != RELAY_WELCOMED;
    memcpy(self->clients.line, line->json, line->length);
    self->clients.line[line->length] = '\n';
    if (first) {
        channel->state = RELAY_WELCOMED;
        channel->served = true;
    }
    if (first && client != NULL) {
        sock_client_reply(client, self->clients.line, line->length + 1U);
    } else if (!hello && client != NULL) {
        sock_client_event(client, self->clients.line, line->length + 1U);
    }
}

static void end_client(relay_t *self, relay_channel_t *channel) {
    sock_client_t *client = sock_clients_find(&self->clients, channel->client);
    release(channel);
    if (client != NULL) {
        sock_service_finish(&self->clients, client);
    }
}

void relay_end_clients(relay_t *self) {
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        if (self->channel[i].state != RELAY_FREE) {
            end_client(self, &self->channel[i]);
        }
    }
}

void relay_drop_clients(relay_t *self) {
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        end_client(self, &self->channel[i]);
        self->channel[i].served = false;
    }
    if (self->link.state == SERIAL_SILENT) {
        relay_stops_refuse(self);
    }
    if (self->out_sent == 0U) {
        self->out_length = 0; // An incomplete line is ended, or the next one would be lost too.
    }
}

static void poll_channel(relay_t *self, relay_channel_t *channel) {
    sock_client_t *client = sock_clients_find(&self->clients, channel->client);
    if (channel->client == IW_CLIENT_NONE && relay_stops_wait(self, self->now_us)) {
        return;
    }
    if (client == NULL || sock_client_is_closing(client) || sock_client_is_broken(client)) {
        release(channel);
        return;
    }
    if (channel->state != RELAY_WELCOMED && self->now_us >= channel->since_us + RELAY_WELCOME_US) {
        release(channel);
        turn_away(self, client, "the board does not answer to a new client; is its image `gateway`, and not too old?");
        return;
    }
    relay_stops_read_ahead(self, channel, client);
    serial_queue_age(&channel->queue, self->now_us);
    if (channel->queue.unanswered >= RELAY_UNANSWERED) {
        release(channel);
        turn_away(self, client, "the board replied to none of the last requests; connect again");
        return;
    }
    report_answered(self, channel, client);
    client->owed = channel->queue.count > 0U; // A client that has ended stays for its replies.
    if (client->held && !serial_queue_is_full(&channel->queue)) {
        client->held = false;
        sock_client_check_caught_up(client, self->now_us);
    }
}

/// Opens a channel without a client if stops wait and the board serves none, or does not answer.
static void open_for_stops(relay_t *self) {
    const bool doubt = relay_stops_wait(self, self->now_us - RELAY_DOUBT_US);
    bool wanted = relay_stops_wait(self, self->now_us);
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        const relay_channel_t *channel = &self->channel[i];
        const bool opens = channel->state != RELAY_FREE;
        wanted = wanted && (doubt || (!channel->served && !opens)) && !(opens && channel->client == IW_CLIENT_NONE);
    }
    relay_channel_t *channel = free_channel(self);
    if (wanted && channel != NULL && self->link.state == SERIAL_LINKED) {
        begin(self, channel, IW_CLIENT_NONE, true);
    }
}

void relay_poll_channels(relay_t *self) {
    relay_stops_age(self);
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        if (self->channel[i].state != RELAY_FREE) {
            poll_channel(self, &self->channel[i]);
        }
    }
    open_for_stops(self);
}

uint64_t relay_channels_next_us(const relay_t *self) {
    uint64_t next_us = relay_stops_next_us(self);
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        const relay_channel_t *channel = &self->channel[i];
        const uint64_t then_us =
            (channel->state != RELAY_FREE) ? serial_queue_next_us(&channel->queue, self->now_us) : UINT64_MAX;
        if (then_us < next_us) {
            next_us = then_us;
        }
    }
    return next_us;
}
