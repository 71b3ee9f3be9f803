// SPDX-License-Identifier: MIT
#include "link.h"

#include <stdio.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#define TOPICS      (IWC_WATCH_STATE | IWC_WATCH_BUS | IWC_WATCH_ESTOP | IWC_WATCH_LEASE | IWC_WATCH_STOP)
#define SHORTEST_US 100000U
#define LONGEST_US  2000000U
/// The gateway gives its socket away after it made it: only what lasts is missing rights.
#define DENIED_US 5000000U

bool bridge_link_open(bridge_link_t *self, const bridge_link_terms_t *terms, const bridge_listener_t *listener) {
    *self = (bridge_link_t){.terms = *terms,
                            .listener = *listener,
                            .wait_us = SHORTEST_US,
                            .random = (uint64_t)getpid(), // Of many machines started by one switch.
                            .gateway = iwc_new()};
    return self->gateway != NULL;
}

void bridge_link_close(bridge_link_t *self) {
    iwc_free(self->gateway);
}

static void answer(bridge_question_t *question, const iwc_message_t *reply) {
    const bridge_question_t asked = *question;
    question->id = 0; // First: what is called may ask again.
    if (asked.answer != NULL) {
        asked.answer(asked.context, reply);
    }
}

static void lose(bridge_link_t *self, uint64_t now_us) {
    iwc_close(self->gateway);
    self->is_here = false;
    self->try_us = now_us + SHORTEST_US;
    self->wait_us = SHORTEST_US;
    for (size_t i = 0; i < BRIDGE_ASKED_MAX; i++) {
        if (self->asked[i].id != 0) {
            answer(&self->asked[i], NULL);
        }
    }
    self->listener.gone(self->listener.context, now_us);
    (void)fprintf(stderr, "%s: the gateway at %s is gone; waiting for it\n", self->terms.program, self->terms.socket);
    self->told_away = true;
}

// ---- connecting ---------------------------------------------------------------------------------------------------

uint64_t bridge_backoff_us(uint64_t *wait_us, uint64_t longest_us, uint64_t *random, uint64_t now_us) {
    *random = *random * 6364136223846793005U + (now_us | 1U);
    *wait_us = (*wait_us * 2U > longest_us) ? longest_us : *wait_us * 2U;
    return now_us + *wait_us / 2U + (*random >> 33) % (*wait_us / 2U);
}

static int judge_rights(bridge_link_t *self, iwc_result_t result, uint64_t now_us) {
    if (result == IWC_DENIED) {
        self->denied_us = (self->denied_us != 0U) ? self->denied_us : now_us;
    } else {
        self->denied_us = 0;
    }
    if (self->terms.drives && result == IWC_OK && iwc_watches_only(self->gateway)) {
        (void)fprintf(
            stderr,
            "%s: %s is for watching only; let socket under [gateway] name the one to drive by, or set enabled = no "
            "under [drive]\n",
            self->terms.program, self->terms.socket);
        return EX_NOPERM;
    }
    if (self->denied_us != 0U && now_us - self->denied_us >= DENIED_US) {
        (void)fprintf(stderr, "%s: %s may not be used by this user; put it into group %s\n", self->terms.program,
                      self->terms.socket,
                      self->terms.drives ? "iwheel (a drop-in for that is among the examples in /usr/share/doc)"
                                         : "iwheel-watch");
        return EX_NOPERM;
    }
    return 0;
}

static int connect_now(bridge_link_t *self, uint64_t now_us) {
    iwc_result_t result = iwc_connect(self->gateway, self->terms.socket, BRIDGE_GREETING_MS);
    const int rights = judge_rights(self, result, now_us);
    if (rights == 0 && (result == IWC_OK || result == IWC_NEWER)) {
        result = iwc_watch(self->gateway, TOPICS, (int)self->terms.rate_hz, BRIDGE_GREETING_MS);
    }
    if (rights != 0 || result != IWC_OK) {
        if (!self->told_away) {
            (void)fprintf(stderr, "%s: no gateway at %s (%s); waiting for it\n", self->terms.program,
                          self->terms.socket, iwc_words(result));
        }
        self->told_away = true;
        iwc_close(self->gateway);
        self->try_us = bridge_backoff_us(&self->wait_us, LONGEST_US, &self->random, now_us);
        return rights;
    }
    self->is_here = true;
    self->told_away = false;
    self->connections++;
    (void)fprintf(stderr, "%s: connected to the gateway at %s\n", self->terms.program, self->terms.socket);
    self->listener.here(self->listener.context, now_us);
    return 0;
}

// ---- listening ----------------------------------------------------------------------------------------------------

static void take_reply(bridge_link_t *self, const iwc_message_t *message) {
    for (size_t i = 0; i < BRIDGE_ASKED_MAX; i++) {
        if (message->id != 0 && self->asked[i].id == message->id) {
            answer(&self->asked[i], message);
            return;
        }
    }
}

static void listen_now(bridge_link_t *self, uint64_t now_us) {
    iwc_message_t message;
    iwc_result_t result = self->terms.latest ? iwc_latest(self->gateway) : IWC_OK;
    for (unsigned i = 0; i < 256U; i++) {
        result = iwc_next(self->gateway, 0, &message);
        if (result != IWC_OK) {
            break;
        }
        if (message.is_event) {
            self->listener.event(self->listener.context, &message, now_us);
        } else {
            take_reply(self, &message);
        }
    }
    if (result == IWC_CLOSED || result == IWC_GARBLED) {
        lose(self, now_us);
    }
}

static void give_up(bridge_link_t *self, uint64_t now_us) {
    bool stop_lost = false;
    for (size_t i = 0; i < BRIDGE_ASKED_MAX; i++) {
        if (self->asked[i].id != 0 && now_us >= self->asked[i].until_us) {
            stop_lost = stop_lost || self->asked[i].is_stop;
            answer(&self->asked[i], NULL);
        }
    }
    if (stop_lost && self->is_here) {
        lose(self, now_us);
    }
}

int bridge_link_step(bridge_link_t *self, uint64_t now_us) {
    if (self->is_here) {
        listen_now(self, now_us);
    } else if (now_us >= self->try_us) {
        const int code = connect_now(self, now_us);
        if (code != 0) {
            return code;
        }
    }
    give_up(self, now_us);
    return 0;
}

uint64_t bridge_link_next_us(const bridge_link_t *self, uint64_t now_us) {
    uint64_t next_us = self->is_here ? UINT64_MAX : self->try_us;
    for (size_t i = 0; i < BRIDGE_ASKED_MAX; i++) {
        if (self->asked[i].id != 0 && self->asked[i].until_us < next_us) {
            next_us = self->asked[i].until_us;
        }
    }
    return (self->is_here && iwc_pending(self->gateway)) ? now_us : next_us;
}

int bridge_link_fd(const bridge_link_t *self) {
    return self->is_here ? iwc_fd(self->gateway) : -1;
}

static bool is_request(const char *request, const char *cmd) {
    static const char begin[] = "{\"cmd\":\"";
    const size_t length = strlen(cmd);
    return strncmp(request, begin, sizeof begin - 1U) == 0 && strncmp(request + sizeof begin - 1U, cmd, length) == 0 &&
           request[sizeof begin - 1U + length] == '"';
}

bool bridge_link_ask(bridge_link_t *self, const char *request, bridge_answer_t what, void *context, uint64_t now_us) {
    const bool is_stop = is_request(request, "stop") || is_request(request, "estop");
    for (size_t i = 0; self->is_here && i < BRIDGE_ASKED_MAX; i++) {
        bridge_question_t *question = &self->asked[i];
        if (question->id != 0) {
            continue;
        }
        int64_t id = 0;
        const iwc_result_t result = iwc_send(self->gateway, request, 0, &id);
        if (result == IWC_OK) {
            *question =
                (bridge_question_t){id, now_us + (is_stop ? BRIDGE_STOP_US : BRIDGE_ANSWER_US), is_stop, what, context};
        } else if (is_stop || result == IWC_CLOSED) {
            lose(self, now_us);
        }
        return result == IWC_OK;
    }
    return false;
}

void bridge_link_forget(bridge_link_t *self, const void *context) {
    for (size_t i = 0; i < BRIDGE_ASKED_MAX; i++) {
        if (self->asked[i].context == context) {
            self->asked[i].answer = NULL;
        }
    }
}
