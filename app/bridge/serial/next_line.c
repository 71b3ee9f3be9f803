// SPDX-License-Identifier: MIT
// Lines to the board, in the order of their importance.
#include "relay.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

static size_t write_line(uint8_t channel, const char *json, size_t length, char *out, size_t size) {
    return iwn_line_write(&(iwn_line_t){.channel = channel, .json = json, .length = length}, out, size);
}

/// Opening and closing of channels precede all requests but stops.
static size_t next_open_or_close(relay_t *self, char *out, size_t size) {
    char json[64];
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        relay_channel_t *channel = &self->channel[i];
        const bool again = channel->state == RELAY_OPENING && self->now_us >= channel->opened_us + RELAY_OPEN_US;
        if (!channel->close_due && channel->state != RELAY_NEW && !again) {
            continue;
        }
        channel->served = false;
        if (channel->close_due) {
            channel->close_due = false;
            (void)snprintf(json, sizeof json, "{\"cmd\":\"close\",\"channel\":%u}", i);
        } else {
            channel->state = RELAY_OPENING;
            channel->opened_us = self->now_us;
            (void)snprintf(json, sizeof json, "{\"cmd\":\"open\",\"channel\":%u,\"watch\":%s}", i,
                           channel->watch ? "true" : "false");
        }
        return write_line(0, json, strlen(json), out, size);
    }
    return 0;
}

/// Adds the time at which the request was sent.
static void add_time(const relay_t *self, serial_request_t *request) {
    char text[SERIAL_DATE_MAX];
    const int length =
        snprintf(text, sizeof text, "{\"t_us\":%" PRIu64 ",", serial_link_time(&self->link, request->came_us));
    memmove(&request->json[length], &request->json[1], request->length - 1U);
    memcpy(request->json, text, (size_t)length);
    request->length += (size_t)length - 1U;
}

static size_t next_request(relay_t *self, char *out, size_t size) {
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        const unsigned number = 1U + (self->next_channel + i) % IWN_LINE_CHANNELS;
        relay_channel_t *channel = &self->channel[number];
        serial_request_t *request =
            (channel->state == RELAY_WELCOMED) ? serial_queue_next(&channel->queue, self->now_us) : NULL;
        if (request != NULL) {
            self->next_channel = number % IWN_LINE_CHANNELS;
            if (request->undated && self->now_us >= request->came_us + SERIAL_DATED_US) {
                add_time(self, request);
            }
            serial_queue_sent(request, self->now_us);
            return write_line((uint8_t)number, request->json, request->length, out, size);
        }
    }
    return 0;
}

static size_t next_sign_of_life(relay_t *self, char *out, size_t size) {
    static const char alive[] = "{\"cmd\":\"alive\"}";
    if (self->link.state == SERIAL_SILENT && self->now_us >= self->asked_us + RELAY_ASK_US) {
        self->asked_us = self->now_us;
        return write_line(0, RELAY_ASK, sizeof RELAY_ASK - 1U, out, size);
    }
    return (self->link.state == SERIAL_LINKED && sock_clients_count(&self->clients) > 0U &&
            self->now_us >= self->written_us + RELAY_ALIVE_US)
               ? write_line(0, alive, sizeof alive - 1U, out, size)
               : 0U;
}

size_t relay_next_line(relay_t *self, char *out, size_t size) {
    size_t length = 0;
    if (self->link.state == SERIAL_LINKED) {
        length = relay_next_stop(self, out, size);
        if (length == 0U) {
            length = next_open_or_close(self, out, size);
        }
    }
    if (length == 0U) {
        length = next_sign_of_life(self, out, size);
    }
    return (length > 0U || self->link.state == SERIAL_SILENT) ? length : next_request(self, out, size);
}

bool relay_has_ended(const relay_t *self) {
    bool waits = relay_stops_wait(self, self->now_us) || self->out_length > 0U;
    for (unsigned i = 1; i <= IWN_LINE_CHANNELS; i++) {
        waits = waits || self->channel[i].state != RELAY_FREE || self->channel[i].close_due;
    }
    return !waits || self->link.state == SERIAL_SILENT || self->now_us >= self->ends_us;
}
