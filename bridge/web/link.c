// SPDX-License-Identifier: MIT
#include "link.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define TOPICS      (IWC_WATCH_STATE | IWC_WATCH_BUS | IWC_WATCH_ESTOP | IWC_WATCH_LEASE | IWC_WATCH_STOP)
#define SHORTEST_US 100000U
#define LONGEST_US  2000000U
#define STALE_US    2000000U
/// The gateway gives its socket away after it made it: only what lasts is missing rights.
#define DENIED_US 5000000U
/// The frames after a stop are there then.
#define WHY_US 2500000U

bool web_link_open(web_link_t *self, const char *socket, unsigned rate_hz, bool drives) {
    *self = (web_link_t){.socket = socket, .rate_hz = rate_hz, .drives = drives, .wait_us = SHORTEST_US, .random = 1};
    self->gateway = iwc_new();
    return self->gateway != NULL;
}

static void forget_state(web_link_t *self) {
    free(self->state);
    self->state = NULL;
    web_feed_forget(&self->feed);
}

void web_link_close(web_link_t *self) {
    iwc_free(self->gateway);
    forget_state(self);
    web_feed_free(&self->feed);
    for (size_t i = 0; i < WEB_STOPS_KEPT; i++) {
        free(self->stops[i]);
    }
}

static void answer(web_question_t *question, const iwc_message_t *reply) {
    const web_question_t asked = *question;
    question->id = 0; // First: what is called may ask again.
    if (asked.answer != NULL) {
        asked.answer(asked.context, reply);
    }
}

static void lose(web_link_t *self, uint64_t now_us) {
    iwc_close(self->gateway);
    self->is_here = false;
    self->try_us = now_us + SHORTEST_US;
    self->wait_us = SHORTEST_US;
    self->why_us = 0;
    forget_state(self);
    for (size_t i = 0; i < WEB_ASKED_MAX; i++) {
        if (self->asked[i].id != 0) {
            answer(&self->asked[i], NULL);
        }
    }
    (void)web_feed_add(&self->feed, "gateway", "{\"event\":\"gateway\",\"connected\":false}", 37, false);
    (void)fprintf(stderr, "iwheel-web: the gateway at %s is gone; waiting for it\n", self->socket);
    self->told_away = true;
}

// ---- connecting ---------------------------------------------------------------------------------------------------

/// Twice as long each time, and somewhere in its upper half: many bridges do not come at once.
static void wait_longer(web_link_t *self, uint64_t now_us) {
    self->random = self->random * 6364136223846793005U + (now_us | 1U);
    self->wait_us = (self->wait_us * 2U > LONGEST_US) ? LONGEST_US : self->wait_us * 2U;
    self->try_us = now_us + self->wait_us / 2U + (self->random >> 33) % (self->wait_us / 2U);
}

static int judge_rights(web_link_t *self, iwc_result_t result, uint64_t now_us) {
    if (result == IWC_DENIED) {
        self->denied_us = (self->denied_us != 0U) ? self->denied_us : now_us;
    } else {
        self->denied_us = 0;
    }
    if (self->drives && result == IWC_OK && iwc_watches_only(self->gateway)) {
        (void)fprintf(
            stderr,
            "iwheel-web: %s is for watching only; let socket under [gateway] name the one to drive by, or set enabled "
            "= no under [drive]\n",
            self->socket);
        return EX_NOPERM;
    }
    if (self->denied_us != 0U && now_us - self->denied_us >= DENIED_US) {
        (void)fprintf(stderr, "iwheel-web: %s may not be used by this user; put it into group %s\n", self->socket,
                      self->drives ? "iwheel (a drop-in for that is in /usr/share/doc/iwheel-web/examples)"
                                   : "iwheel-watch");
        return EX_NOPERM;
    }
    return 0;
}

static int connect_now(web_link_t *self, uint64_t now_us) {
    iwc_result_t result = iwc_connect(self->gateway, self->socket, WEB_GREETING_MS);
    const int rights = judge_rights(self, result, now_us);
    if (rights == 0 && (result == IWC_OK || result == IWC_NEWER)) {
        result = iwc_watch(self->gateway, TOPICS, (int)self->rate_hz, WEB_GREETING_MS);
    }
    if (rights != 0 || result != IWC_OK) {
        if (!self->told_away) {
            (void)fprintf(stderr, "iwheel-web: no gateway at %s (%s); waiting for it\n", self->socket,
                          iwc_words(result));
        }
        self->told_away = true;
        iwc_close(self->gateway);
        wait_longer(self, now_us);
        return rights;
    }
    self->is_here = true;
    self->told_away = false;
    self->connections++;
    self->why_us = now_us;
    (void)web_feed_add(&self->feed, "gateway", "{\"event\":\"gateway\",\"connected\":true}", 36, false);
    (void)fprintf(stderr, "iwheel-web: connected to the gateway at %s\n", self->socket);
    return 0;
}

// ---- listening ----------------------------------------------------------------------------------------------------

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
    // The same stop again, now with its frames, or its recording: in place of the first.
    const bool same = self->stops[0] != NULL && (uint64_t)number.value == self->stop_number;
    free(self->stops[same ? 0 : WEB_STOPS_KEPT - 1U]);
    if (!same) {
        memmove(&self->stops[1], &self->stops[0], (WEB_STOPS_KEPT - 1U) * sizeof self->stops[0]);
    }
    self->stops[0] = copy;
    self->stop_number = (uint64_t)number.value;
    (void)web_feed_add(&self->feed, "stops", "{\"event\":\"stops\"}", 17, false);
}

static void take_why(void *context, const iwc_message_t *reply) {
    if (reply != NULL) {
        keep_stop(context, reply);
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

static void take_event(web_link_t *self, const iwc_message_t *message, uint64_t now_us) {
    char name[32];
    (void)iwc_text(message, "event", name, sizeof name);
    if (strcmp(name, "state") == 0) {
        take_state(self, message, now_us);
        return;
    }
    if (strcmp(name, "stop") == 0) {
        keep_stop(self, message); // Another one may come before its frames do.
        (void)web_link_ask(self, "{\"cmd\":\"why\"}", take_why, self, now_us);
        self->why_us = now_us + WHY_US;
    }
    (void)web_feed_add(&self->feed, name, message->text, message->length, false);
}

static void take_reply(web_link_t *self, const iwc_message_t *message) {
    for (size_t i = 0; i < WEB_ASKED_MAX; i++) {
        if (message->id != 0 && self->asked[i].id == message->id) {
            answer(&self->asked[i], message);
            return;
        }
    }
}

static void listen_now(web_link_t *self, uint64_t now_us) {
    iwc_message_t message;
    iwc_result_t result = iwc_latest(self->gateway);
    for (unsigned i = 0; i < 256U; i++) {
        result = iwc_next(self->gateway, 0, &message);
        if (result != IWC_OK) {
            break;
        }
        if (message.is_event) {
            take_event(self, &message, now_us);
        } else {
            take_reply(self, &message);
        }
    }
    if (result == IWC_CLOSED || result == IWC_GARBLED) {
        lose(self, now_us);
    }
}

static void give_up(web_link_t *self, uint64_t now_us) {
    bool stop_lost = false;
    for (size_t i = 0; i < WEB_ASKED_MAX; i++) {
        if (self->asked[i].id != 0 && now_us >= self->asked[i].until_us) {
            stop_lost = stop_lost || self->asked[i].is_stop;
            answer(&self->asked[i], NULL);
        }
    }
    if (stop_lost && self->is_here) {
        lose(self, now_us);
    }
}

int web_link_step(web_link_t *self, uint64_t now_us) {
    if (self->is_here) {
        listen_now(self, now_us);
    } else if (now_us >= self->try_us) {
        const int code = connect_now(self, now_us);
        if (code != 0) {
            return code;
        }
    }
    give_up(self, now_us);
    if (self->is_here && self->why_us != 0U && now_us >= self->why_us) {
        self->why_us = 0;
        (void)web_link_ask(self, "{\"cmd\":\"why\"}", take_why, self, now_us);
    }
    return 0;
}

uint64_t web_link_next_us(const web_link_t *self, uint64_t now_us) {
    uint64_t next_us = self->is_here ? UINT64_MAX : self->try_us;
    for (size_t i = 0; i < WEB_ASKED_MAX; i++) {
        if (self->asked[i].id != 0 && self->asked[i].until_us < next_us) {
            next_us = self->asked[i].until_us;
        }
    }
    if (self->is_here && self->why_us != 0U && self->why_us < next_us) {
        next_us = self->why_us;
    }
    return (self->is_here && iwc_pending(self->gateway)) ? now_us : next_us;
}

int web_link_fd(const web_link_t *self) {
    return self->is_here ? iwc_fd(self->gateway) : -1;
}

bool web_link_ask(web_link_t *self, const char *request, web_answer_t what, void *context, uint64_t now_us) {
    const bool is_stop = strstr(request, "stop\"") != NULL; // stop, estop
    for (size_t i = 0; self->is_here && i < WEB_ASKED_MAX; i++) {
        web_question_t *question = &self->asked[i];
        if (question->id != 0) {
            continue;
        }
        int64_t id = 0;
        const iwc_result_t result = iwc_send(self->gateway, request, 0, &id);
        if (result == IWC_OK) {
            *question = (web_question_t){id, now_us + (is_stop ? WEB_STOP_US : WEB_ANSWER_US), is_stop, what, context};
        } else if (is_stop || result == IWC_CLOSED) {
            lose(self, now_us);
        }
        return result == IWC_OK;
    }
    return false;
}

void web_link_forget(web_link_t *self, const void *context) {
    for (size_t i = 0; i < WEB_ASKED_MAX; i++) {
        if (self->asked[i].context == context) {
            self->asked[i].answer = NULL;
        }
    }
}

bool web_link_state(const web_link_t *self, uint64_t now_us, iwc_message_t *out_state) {
    if (!self->is_here || self->state == NULL || now_us - self->state_us > STALE_US) {
        return false;
    }
    *out_state = (iwc_message_t){.text = self->state, .length = self->state_length, .is_event = true};
    return true;
}
