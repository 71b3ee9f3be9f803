// SPDX-License-Identifier: MIT
#include "web_link.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STALE_US 2000000U
/// Rate of the event `state` while no client reads it. The first state that a client reads is still fresh.
#define IDLE_HZ 2U
/// Time from the last read of the state by a client to that rate.
#define POLLED_US 5000000U
/// Delay after a stop until the frames after it are recorded.
#define WHY_US 2500000U
/// Delay of another try when all places for questions are in use.
#define WHY_AGAIN_US 200000U

static char *copy_of(const iwc_message_t *message) {
    char *copy = malloc(message->length + 1U);
    if (copy != NULL) {
        memcpy(copy, message->text, message->length);
        copy[message->length] = '\0';
    }
    return copy;
}

static void keep_stop(web_link_t *self, const iwc_message_t *reply) {
    const iwc_value_t number = iwc_integer(reply, "number");
    if (!number.known || number.value <= 0) {
        return;
    }
    char *copy = copy_of(reply);
    if (copy == NULL) {
        return;
    }
    // The same stop again, now with its frames or its recording, replaces the first reply.
    const bool same = self->stops[0] != NULL && (uint64_t)number.value == self->stop_number;
    free(self->stops[same ? 0 : WEB_STOPS_STORED - 1U]);
    if (!same) {
        memmove(&self->stops[1], &self->stops[0], (WEB_STOPS_STORED - 1U) * sizeof self->stops[0]);
    }
    self->stops[0] = copy;
    self->stop_number = (uint64_t)number.value;
    (void)web_feed_add(&self->feed, "stops", "{\"event\":\"stops\"}", 17, false);
}

static void take_why(void *context, const iwc_message_t *reply) {
    if (reply != NULL) {
        web_link_t *self = context;
        web_tally_take(&self->tally, reply, false);
        keep_stop(self, reply);
    }
}

static void take_state(web_link_t *self, const iwc_message_t *message, uint64_t now_us) {
    char *copy = copy_of(message);
    if (copy != NULL) {
        free(self->state);
        self->state = copy;
        self->state_length = message->length;
        self->state_us = now_us;
    }
    (void)web_feed_add(&self->feed, "state", message->text, message->length, true);
}

static void take_event(void *context, const iwc_message_t *message, uint64_t now_us) {
    web_link_t *self = context;
    char name[32];
    (void)iwc_text(message, "event", name, sizeof name);
    if (strcmp(name, "state") == 0) {
        take_state(self, message, now_us);
        return;
    }
    if (strcmp(name, "stop") == 0) {
        bridge_lease_end(&self->lease, now_us);
        web_tally_take(&self->tally, message, true);
        keep_stop(self, message); // Another stop may happen before the frames are recorded.
        (void)bridge_link_ask(&self->gateway, "{\"cmd\":\"why\"}", take_why, self, now_us);
        self->why_us = now_us + WHY_US;
    }
    (void)web_feed_add(&self->feed, name, message->text, message->length, false);
}

static void forget_state(web_link_t *self) {
    free(self->state);
    self->state = NULL;
    web_feed_forget(&self->feed);
}

static void gateway_here(void *context, uint64_t now_us) {
    web_link_t *self = context;
    self->why_us = now_us;
    self->polled_us = now_us;
    (void)web_feed_add(&self->feed, "gateway", "{\"event\":\"gateway\",\"connected\":true}", 36, false);
}

static void gateway_gone(void *context, uint64_t now_us) {
    web_link_t *self = context;
    self->why_us = 0;
    bridge_lease_end(&self->lease, now_us);
    forget_state(self);
    (void)web_feed_add(&self->feed, "gateway", "{\"event\":\"gateway\",\"connected\":false}", 37, false);
}

bool web_link_open(web_link_t *self, const char *socket, unsigned rate_hz, bool drives) {
    const bridge_link_terms_t terms = {"iwheel-web", socket, rate_hz, drives, true};
    const bridge_listener_t listener = {self, gateway_here, gateway_gone, take_event};
    *self = (web_link_t){.rate_hz = rate_hz};
    return bridge_link_open(&self->gateway, &terms, &listener) &&
           bridge_lease_open(&self->lease, socket, self->gateway.epoll_fd);
}

void web_link_close(web_link_t *self) {
    bridge_lease_close(&self->lease);
    bridge_link_close(&self->gateway);
    forget_state(self);
    web_feed_free(&self->feed);
    for (size_t i = 0; i < WEB_STOPS_STORED; i++) {
        free(self->stops[i]);
    }
}

int web_link_step(web_link_t *self, uint64_t now_us) {
    const bool idle = now_us - self->polled_us > POLLED_US && self->rate_hz > IDLE_HZ;
    bridge_link_rate(&self->gateway, idle ? IDLE_HZ : self->rate_hz, now_us);
    const int code = bridge_link_step(&self->gateway, now_us);
    bridge_lease_step(&self->lease, now_us);
    if (self->gateway.state == BRIDGE_LINK_HERE && self->why_us != 0U && now_us >= self->why_us) {
        const bool asked = bridge_link_ask(&self->gateway, "{\"cmd\":\"why\"}", take_why, self, now_us);
        self->why_us = asked ? 0U : now_us + WHY_AGAIN_US;
    }
    return code;
}

uint64_t web_link_next_us(const web_link_t *self, uint64_t now_us) {
    const uint64_t lease_us = bridge_lease_next_us(&self->lease, now_us);
    uint64_t next_us = bridge_link_next_us(&self->gateway, now_us);
    if (lease_us < next_us) {
        next_us = lease_us;
    }
    const bool asks = self->gateway.state == BRIDGE_LINK_HERE && self->why_us != 0U && self->why_us < next_us;
    return asks ? self->why_us : next_us;
}

bool web_link_state(const web_link_t *self, uint64_t now_us, iwc_message_t *out_state) {
    if (self->gateway.state != BRIDGE_LINK_HERE || self->state == NULL || now_us - self->state_us > STALE_US) {
        return false;
    }
    *out_state = (iwc_message_t){.text = self->state, .length = self->state_length, .is_event = true};
    return true;
}

char *web_link_status(const web_link_t *self, uint64_t now_us, size_t *out_length) {
    static const char yes[] = "{\"ok\":true,";
    iwc_message_t state;
    const char *rest = web_link_state(self, now_us, &state) ? strchr(state.text, ',') : NULL; // After the event name.
    char *text = (rest != NULL) ? malloc(state.length + sizeof yes) : NULL;
    if (text != NULL) {
        *out_length = (size_t)sprintf(text, "%s%s", yes, rest + 1);
    }
    return text;
}
