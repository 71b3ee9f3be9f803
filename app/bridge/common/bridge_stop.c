// SPDX-License-Identifier: MIT
#include "bridge_stop.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define SHORTEST_US 100000U
#define LONGEST_US  2000000U
/// Interval of tries while a person waits for a stop.
#define URGENT_US 20000U
/// After the end of a line that lasted this time, a new one follows soon.
#define LASTING_US 1000000U

static bool is_request(const char *request, const char *cmd) {
    static const char begin[] = "{\"cmd\":\"";
    const size_t length = strlen(cmd);
    return strncmp(request, begin, sizeof begin - 1U) == 0 && strncmp(request + sizeof begin - 1U, cmd, length) == 0 &&
           request[sizeof begin - 1U + length] == '"';
}

bool bridge_is_stop(const char *request) {
    return is_request(request, "stop") || is_request(request, "estop");
}

uint64_t bridge_backoff_us(uint64_t *wait_us, uint64_t longest_us, uint64_t *random, uint64_t now_us) {
    *random = *random * 6364136223846793005U + (now_us | 1U);
    *wait_us = (*wait_us * 2U > longest_us) ? longest_us : *wait_us * 2U;
    return now_us + *wait_us / 2U + (*random >> 33) % (*wait_us / 2U);
}

bool bridge_stop_open(bridge_stop_t *self, const char *socket, int epoll_fd) {
    memset(self, 0, sizeof *self);
    self->wait_us = SHORTEST_US;
    self->random = (uint64_t)getpid(); // Different on machines that one switch starts at the same time.
    for (int kind = 0; kind < BRIDGE_STOP_KINDS; kind++) {
        self->tag[kind] = (bridge_stop_tag_t){self, (bridge_stop_kind_t)kind};
    }
    return bridge_line_open(&self->line, socket, epoll_fd);
}

static void settle(bridge_stop_asker_t *asker, const iwc_message_t *reply) {
    const bridge_stop_asker_t asked = *asker;
    asker->state = BRIDGE_STOP_FREE; // Before the call, because the answer may ask again.
    if (asked.answer != NULL) {
        asked.answer(asked.context, reply);
    }
}

/// Passes the reply to all askers of the request that was sent.
static void take_reply(void *context, const iwc_message_t *reply) {
    const bridge_stop_tag_t *tag = context;
    bridge_stop_t *self = tag->stop;
    self->in_flight[tag->kind] = false;
    for (size_t i = 0; i < BRIDGE_STOPS_MAX; i++) {
        if (self->askers[i].state == BRIDGE_STOP_SENT && self->askers[i].kind == tag->kind) {
            settle(&self->askers[i], reply);
        }
    }
}

void bridge_stop_close(bridge_stop_t *self) {
    bridge_line_close(&self->line);
    for (size_t i = 0; i < BRIDGE_STOPS_MAX; i++) {
        if (self->askers[i].state != BRIDGE_STOP_FREE) {
            settle(&self->askers[i], NULL);
        }
    }
}

static bool is_wanted(const bridge_stop_t *self) {
    return self->wanted_until_us[BRIDGE_STOP] != 0U || self->wanted_until_us[BRIDGE_ESTOP] != 0U;
}

static void send_wanted(bridge_stop_t *self, bridge_stop_kind_t kind, uint64_t now_us) {
    if (self->wanted_until_us[kind] == 0U || self->in_flight[kind] || self->line.state != BRIDGE_HERE) {
        return;
    }
    const bridge_sent_t sent = {0, now_us + BRIDGE_STOP_US, take_reply, &self->tag[kind]};
    if (bridge_line_send(&self->line, self->request[kind], &sent) != IWC_OK) {
        bridge_line_drop(&self->line,
                         IWC_CLOSED); // The gateway does not read, or is gone; a new connection may reach it.
        self->try_us = now_us;
        return;
    }
    self->wanted_until_us[kind] = 0;
    self->in_flight[kind] = true;
    for (size_t i = 0; i < BRIDGE_STOPS_MAX; i++) {
        if (self->askers[i].state == BRIDGE_STOP_WAITS && self->askers[i].kind == kind) {
            self->askers[i].state = BRIDGE_STOP_SENT;
        }
    }
}

static void give_up(bridge_stop_t *self, uint64_t now_us) {
    for (size_t i = 0; is_wanted(self) && i < BRIDGE_STOPS_MAX; i++) {
        if (self->askers[i].state == BRIDGE_STOP_WAITS && now_us >= self->askers[i].until_us) {
            settle(&self->askers[i], NULL);
        }
    }
    for (int kind = 0; kind < BRIDGE_STOP_KINDS; kind++) {
        if (now_us >= self->wanted_until_us[kind]) {
            self->wanted_until_us[kind] = 0; // Its askers were answered that it was not delivered.
        }
    }
}

static void plan_try(bridge_stop_t *self, uint64_t now_us) {
    const uint64_t later_us = bridge_backoff_us(&self->wait_us, LONGEST_US, &self->random, now_us);
    self->try_us = is_wanted(self) ? now_us + URGENT_US : later_us;
}

static bool connect_now(bridge_stop_t *self, uint64_t now_us) {
    self->since_us = now_us;
    return bridge_line_connect_for_stop(&self->line);
}

static void listen_now(bridge_stop_t *self, uint64_t now_us) {
    iwc_message_t event;
    while (bridge_line_next(&self->line, &event)) {
        // Events are not used here.
    }
    if (bridge_line_expire(&self->line, now_us) > 0U) {
        bridge_line_drop(&self->line, IWC_TIMEOUT);
    }
    if (self->line.state == BRIDGE_AWAY) {
        // A connection that the gateway accepts for stops only may end after a moment. Such an end does not shorten the
        // next delay.
        if (now_us - self->since_us >= LASTING_US) {
            self->wait_us = SHORTEST_US;
        }
        plan_try(self, now_us);
    }
}

void bridge_stop_step(bridge_stop_t *self, uint64_t now_us) {
    if (self->line.state == BRIDGE_AWAY && now_us >= self->try_us) {
        plan_try(self, now_us);
        (void)connect_now(self, now_us);
    }
    if (self->line.state == BRIDGE_HERE) {
        listen_now(self, now_us);
    }
    send_wanted(self, BRIDGE_ESTOP, now_us);
    send_wanted(self, BRIDGE_STOP, now_us);
    give_up(self, now_us);
}

uint64_t bridge_stop_next_us(const bridge_stop_t *self, uint64_t now_us) {
    uint64_t next_us = (self->line.state == BRIDGE_AWAY) ? self->try_us : bridge_line_next_us(&self->line, now_us);
    for (size_t i = 0; is_wanted(self) && i < BRIDGE_STOPS_MAX; i++) {
        if (self->askers[i].state == BRIDGE_STOP_WAITS && self->askers[i].until_us < next_us) {
            next_us = self->askers[i].until_us;
        }
    }
    return next_us;
}

static void add_asker(bridge_stop_t *self, const bridge_stop_asker_t *asker) {
    for (size_t i = 0; i < BRIDGE_STOPS_MAX; i++) {
        if (self->askers[i].state == BRIDGE_STOP_FREE) {
            self->askers[i] = *asker;
            return;
        }
    }
    if (asker->answer != NULL) {
        asker->answer(asker->context, NULL); // The stop is sent with the others; only its reply has no place.
    }
}

bool bridge_stop_ask(bridge_stop_t *self, const char *request, bridge_answer_t answer, void *context, uint64_t now_us) {
    const bridge_stop_kind_t kind = is_request(request, "estop") ? BRIDGE_ESTOP : BRIDGE_STOP;
    const bridge_stop_asker_t asker = {BRIDGE_STOP_WAITS, kind, now_us + BRIDGE_STOP_US, answer, context};
    if (strlen(request) >= BRIDGE_REQUEST_SIZE) {
        return false;
    }
    if (self->line.state == BRIDGE_AWAY && !connect_now(self, now_us) && self->line.result != IWC_TIMEOUT) {
        return false;
    }
    if (self->wanted_until_us[kind] == 0U) {
        (void)snprintf(self->request[kind], sizeof self->request[kind], "%s", request);
    }
    self->wanted_until_us[kind] = now_us + BRIDGE_STOP_US;
    add_asker(self, &asker);
    send_wanted(self, kind, now_us);
    return true;
}

void bridge_stop_forget(bridge_stop_t *self, const void *context) {
    for (size_t i = 0; i < BRIDGE_STOPS_MAX; i++) {
        if (self->askers[i].context == context) {
            self->askers[i].answer = NULL;
        }
    }
}
