// SPDX-License-Identifier: MIT
#include "feed.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// One message, shared by the feed and by readers that are sending it.
struct web_message {
    unsigned holders;
    size_t length;
    char text[];
};

static void let_go(web_message_t *message) {
    if (message != NULL && --message->holders == 0U) {
        free(message);
    }
}

static web_message_t *hold(web_message_t *message) {
    message->holders++;
    return message;
}

static web_message_t *make(const char *name, const char *json, size_t length) {
    static const char end[] = {'\n', '\n'};
    const size_t size = length + strlen(name) + sizeof "event: \ndata: \n\n";
    web_message_t *message = malloc(sizeof(*message) + size);
    if (message != NULL) {
        message->holders = 1;
        message->length = (size_t)snprintf(message->text, size, "event: %s\ndata: ", name);
        memcpy(message->text + message->length, json, length);
        memcpy(message->text + message->length + length, end, sizeof end);
        message->length += length + sizeof end;
    }
    return message;
}

bool web_feed_add(web_feed_t *self, const char *name, const char *json, size_t length, bool is_state) {
    web_message_t *message = make(name, json, length);
    if (message == NULL) {
        return false;
    }
    web_message_t **place = is_state ? &self->state : &self->events[self->count % WEB_FEED_STORED];
    let_go(*place);
    *place = message;
    *(is_state ? &self->states : &self->count) += 1U;
    return true;
}

void web_feed_forget(web_feed_t *self) {
    let_go(self->state);
    self->state = NULL;
}

void web_feed_free(web_feed_t *self) {
    web_feed_forget(self);
    for (size_t i = 0; i < WEB_FEED_STORED; i++) {
        let_go(self->events[i]);
        self->events[i] = NULL;
    }
}

void web_reader_begin(web_reader_t *self, const web_feed_t *feed) {
    *self = (web_reader_t){.event = feed->count, .state = (feed->states > 0U) ? feed->states - 1U : 0U};
}

void web_reader_end(web_reader_t *self) {
    let_go(self->sending);
    self->sending = NULL;
}

/// Returns the next message. Events precede the state, because they led to it.
static web_message_t *next(web_reader_t *self, web_feed_t *feed) {
    char json[64];
    const uint64_t oldest = (feed->count > WEB_FEED_STORED) ? feed->count - WEB_FEED_STORED : 0U;
    if (self->event < oldest) {
        const int length =
            snprintf(json, sizeof json, "{\"event\":\"lost\",\"count\":%" PRIu64 "}", oldest - self->event);
        self->event = oldest;
        return make("lost", json, (size_t)length);
    }
    if (self->event < feed->count) {
        return hold(feed->events[self->event++ % WEB_FEED_STORED]);
    }
    if (self->state != feed->states && feed->state != NULL) {
        self->state = feed->states;
        return hold(feed->state);
    }
    return NULL;
}

bool web_reader_waits(const web_reader_t *self, const web_feed_t *feed) {
    return self->sending != NULL || self->event < feed->count || (self->state != feed->states && feed->state != NULL);
}

size_t web_reader_take(web_reader_t *self, web_feed_t *feed, char *out, size_t size) {
    if (self->sending == NULL) {
        self->sending = next(self, feed);
        self->sent = 0;
    }
    if (self->sending == NULL) {
        return 0;
    }
    const size_t left = self->sending->length - self->sent;
    const size_t copied = (left < size) ? left : size;
    memcpy(out, self->sending->text + self->sent, copied);
    self->sent += copied;
    if (self->sent == self->sending->length) {
        web_reader_end(self);
    }
    return copied;
}
