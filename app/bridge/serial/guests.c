// SPDX-License-Identifier: MIT
// Requests on the line, and clients beyond the maximum, which have no channel: their stop requests use the channels of
// others.
#include "relay.h"

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

/// Returns the open channel with the fewest requests; NULL if none has space.
static relay_channel_t *quietest_channel(relay_t *self) {
    relay_channel_t *found = NULL;
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        relay_channel_t *channel = &self->channel[i];
        const bool open = channel->state == RELAY_WELCOMED && !channel->close_due;
        if (open && !serial_queue_is_full(&channel->queue) &&
            (found == NULL || channel->queue.count < found->queue.count)) {
            found = channel;
        }
    }
    return found;
}

/// Sends a stop request of a client without a channel on the channel of another client.
static bool forward_stop(relay_t *self, sock_client_t *client, const iwn_request_t *asked, iwn_json_t root) {
    relay_channel_t *channel = quietest_channel(self);
    if (channel == NULL) {
        return false;
    }
    serial_request_t *place = serial_queue_place(&channel->queue);
    *place = (serial_request_t){.kind = SERIAL_STOPS, .id = asked->id, .came_us = self->now_us, .guest = client->id};
    place->number = ++self->number;
    place->length = relay_write_numbered(root, place->number, place->json, SERIAL_JSON_MAX);
    if (place->length == 0U) {
        return false;
    }
    serial_queue_put(&channel->queue);
    client->owed = true; // Until the board has answered, or its time has expired.
    return true;
}

void relay_guest_carry_out(relay_t *self, sock_client_t *client, const char *line, size_t length) {
    iwn_request_t request;
    iwn_refusal_t refusal;
    const bool stops = iwn_request_read(line, length, &self->work, &request, &refusal) && iwn_cmd_stops(request.cmd);
    if (!stops || !forward_stop(self, client, &request, iwn_json_root(line))) {
        sock_service_refuse_crowd(&self->clients, client, &refusal);
        sock_clients_refuse(&self->clients, client, &request.id, &refusal);
    }
}

sock_client_t *relay_guest_or(relay_t *self, sock_client_t *client, const serial_request_t *request) {
    if (request->guest == IW_CLIENT_NONE) {
        return client;
    }
    sock_client_t *guest = sock_clients_find(&self->clients, request->guest);
    if (guest != NULL) {
        guest->owed = false;
    }
    return guest;
}
