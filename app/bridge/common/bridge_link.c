// SPDX-License-Identifier: MIT
#include "bridge_link.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sysexits.h>
#include <unistd.h>

#define SHORTEST_US 100000U
#define LONGEST_US  2000000U
/// Request that subscribes, with the rate of the event `state`.
#define WATCH "{\"cmd\":\"watch\",\"topics\":[\"state\",\"bus\",\"estop\",\"lease\",\"stop\"],\"rate_hz\":%u}"
/// The gateway creates its socket and then changes the group. Missing rights are reported only after this time.
#define DENIED_US 5000000U
/// Two clocks drift apart by 1 us in this time at most: 100 ppm each.
#define DRIFT_US 5000U
/// A gateway whose clock is behind by less than this time uses the same clock: the difference is the way of its events.
#define SAME_US 100000

bool bridge_link_open(bridge_link_t *self, const bridge_link_terms_t *terms, const bridge_listener_t *listener) {
    memset(self, 0, sizeof *self);
    self->terms = *terms;
    self->listener = *listener;
    self->wait_us = SHORTEST_US;
    self->random = (uint64_t)getpid();
    self->epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    const bool lines = bridge_line_open(&self->line, terms->socket, self->epoll_fd);
    return bridge_stop_open(&self->stop, terms->socket, self->epoll_fd) && lines && self->epoll_fd >= 0;
}

static bridge_question_t take_out(bridge_link_t *self, unsigned at) {
    const bridge_question_t question = self->waits[at];
    self->count--;
    memmove(&self->waits[at], &self->waits[at + 1U], (self->count - at) * sizeof self->waits[0]);
    return question;
}

static void answer_none(bridge_link_t *self, unsigned at) {
    const bridge_question_t question = take_out(self, at); // Before the call, because the answer may ask again.
    if (question.answer != NULL) {
        question.answer(question.context, NULL);
    }
}

void bridge_link_close(bridge_link_t *self) {
    bridge_line_close(&self->line);
    for (unsigned left = self->count; left > 0U; left--) {
        answer_none(self, 0);
    }
    bridge_stop_close(&self->stop);
    (void)close(self->epoll_fd);
}

/// Sets the state AWAY after the loss of the line or a failed try, and plans the next try.
static void lose(bridge_link_t *self) {
    const bridge_link_state_t before = self->state;
    const char *socket = self->terms.socket;
    bridge_line_drop(&self->line, self->line.result);
    self->state = BRIDGE_LINK_AWAY;
    self->has_clock = false;
    if (before == BRIDGE_LINK_HERE) {
        (void)fprintf(stderr, "%s: the gateway at %s is gone; waiting for it\n", self->terms.program, socket);
        for (unsigned left = self->count; left > 0U; left--) {
            answer_none(self, 0);
        }
        self->wait_us = SHORTEST_US;
        self->listener.gone(self->listener.context, self->now_us);
    } else if (before == BRIDGE_LINK_STARTING) {
        (void)fprintf(stderr, "%s: no gateway at %s (%s); waiting for it\n", self->terms.program, socket,
                      iwc_words(self->line.result));
    }
    self->try_us = bridge_backoff_us(&self->wait_us, LONGEST_US, &self->random, self->now_us);
}

/// Sets the state HERE if the gateway accepts the subscription.
static void take_subscribed(void *context, const iwc_message_t *reply) {
    bridge_link_t *self = context;
    if (reply == NULL || iwc_truth(reply, "ok").value != 1) {
        if (self->line.state == BRIDGE_HERE) {
            self->line.result = (reply == NULL) ? IWC_TIMEOUT : IWC_REFUSED;
        }
        return; // `step` finds that the state is not HERE and that no request waits for a reply.
    }
    self->state = BRIDGE_LINK_HERE;
    self->connections++;
    (void)fprintf(stderr, "%s: connected to the gateway at %s\n", self->terms.program, self->terms.socket);
    self->listener.here(self->listener.context, self->now_us);
}

static int judge_rights(bridge_link_t *self) {
    if (self->line.state != BRIDGE_AWAY || self->line.result != IWC_DENIED) {
        self->denied_us = 0;
    } else if (self->denied_us == 0U) {
        self->denied_us = self->now_us;
    }
    if (self->terms.drives && self->line.state == BRIDGE_HERE && iwc_watches_only(self->line.gateway)) {
        (void)fprintf(stderr,
                      "%s: %s is for watching only; set socket under [gateway] to the drive socket, or enabled = no "
                      "under [drive]\n",
                      self->terms.program, self->terms.socket);
        return EX_NOPERM;
    }
    if (self->denied_us != 0U && self->now_us - self->denied_us >= DENIED_US) {
        (void)fprintf(stderr, "%s: this user may not use %s; add the user to group %s\n", self->terms.program,
                      self->terms.socket,
                      self->terms.drives ? "iwheel (a drop-in for that is among the examples in /usr/share/doc)"
                                         : "iwheel-watch");
        return EX_NOPERM;
    }
    return 0;
}

static void subscribe(bridge_link_t *self) {
    char request[128];
    const bridge_sent_t sent = {0, self->now_us + BRIDGE_STOP_US, take_subscribed, self};
    (void)snprintf(request, sizeof request, WATCH, self->terms.rate_hz);
    if (bridge_line_send(&self->line, request, &sent) != IWC_OK) {
        lose(self);
    }
}

/// Makes the connection, in steps that do not wait.
static int come_here(bridge_link_t *self) {
    const bridge_line_state_t before = self->line.state;
    if (before == BRIDGE_AWAY) {
        if (self->now_us < self->try_us) {
            return 0;
        }
        if (!bridge_line_connect(&self->line, self->now_us)) {
            lose(self);
            return judge_rights(self);
        }
    }
    if (self->line.state == BRIDGE_GREETING) {
        if (bridge_line_greet(&self->line, self->now_us) == BRIDGE_AWAY) {
            lose(self);
        } else if (self->line.state == BRIDGE_HERE) {
            subscribe(self);
        }
        return judge_rights(self);
    }
    return 0;
}

static int64_t drifted(const bridge_link_t *self, uint64_t now_us) {
    return self->ahead_us - (int64_t)((now_us - self->ahead_at_us) / DRIFT_US);
}

int64_t bridge_link_ahead_us(const bridge_link_t *self, uint64_t now_us) {
    const int64_t ahead_us = self->has_clock ? drifted(self, now_us) : 0;
    return (ahead_us > -SAME_US && ahead_us < 0) ? 0 : ahead_us;
}

/// An event that was late on the way changes nothing.
static void read_clock(bridge_link_t *self, const iwc_message_t *event) {
    const iwc_value_t t_us = iwc_integer(event, "t_us");
    const int64_t ahead_us = t_us.value - (int64_t)self->now_us;
    if (t_us.known && (!self->has_clock || ahead_us > drifted(self, self->now_us))) {
        self->has_clock = true;
        self->ahead_us = ahead_us;
        self->ahead_at_us = self->now_us;
    }
}

static void listen_now(bridge_link_t *self) {
    iwc_message_t event;
    if (self->terms.latest && self->state == BRIDGE_LINK_HERE) {
        (void)iwc_latest(self->line.gateway); // If the connection has ended, the next line detects it.
    }
    const iwc_t *gateway = self->line.gateway; // Read once: the descriptor stays readable if there is more.
    for (unsigned i = 0; i < 256U && (i == 0U || iwc_pending(gateway)) && bridge_line_next(&self->line, &event); i++) {
        if (self->state == BRIDGE_LINK_HERE) {
            read_clock(self, &event);
            self->listener.event(self->listener.context, &event, self->now_us);
        }
    }
    (void)bridge_line_expire(&self->line, self->now_us);
    const bool subscribing = bridge_line_in_flight(&self->line) > 0U;
    if (self->line.state == BRIDGE_AWAY || (self->state != BRIDGE_LINK_HERE && !subscribing)) {
        lose(self);
    }
}

static void send_waiting(bridge_link_t *self) {
    while (self->state == BRIDGE_LINK_HERE && self->count > 0U &&
           bridge_line_in_flight(&self->line) < BRIDGE_LINE_MAX) {
        const bridge_question_t *question = &self->waits[0];
        const bridge_sent_t sent = {0, question->until_us, question->answer, question->context};
        const iwc_result_t result = bridge_line_send(&self->line, question->request, &sent);
        if (result == IWC_CLOSED) {
            lose(self);
        } else if (result != IWC_OK) {
            answer_none(self, 0); // Never sent later.
        } else {
            (void)take_out(self, 0);
        }
    }
}

static void give_up(bridge_link_t *self) {
    while (self->count > 0U && self->now_us >= self->waits[0].until_us) {
        answer_none(self, 0);
    }
}

int bridge_link_step(bridge_link_t *self, uint64_t now_us) {
    self->now_us = now_us;
    bridge_stop_step(&self->stop, now_us); // Stops precede everything else.
    if (self->line.state != BRIDGE_HERE) {
        const int code = come_here(self);
        if (code != 0) {
            return code;
        }
    }
    if (self->line.state == BRIDGE_HERE) {
        listen_now(self);
    }
    send_waiting(self);
    give_up(self);
    return 0;
}

uint64_t bridge_link_next_us(const bridge_link_t *self, uint64_t now_us) {
    const uint64_t stop_us = bridge_stop_next_us(&self->stop, now_us);
    uint64_t next_us = (self->line.state == BRIDGE_AWAY) ? self->try_us : bridge_line_next_us(&self->line, now_us);
    if (self->count > 0U && self->waits[0].until_us < next_us) {
        next_us = self->waits[0].until_us;
    }
    if (self->state == BRIDGE_LINK_HERE && self->count > 0U && bridge_line_in_flight(&self->line) < BRIDGE_LINE_MAX) {
        return now_us;
    }
    return (stop_us < next_us) ? stop_us : next_us;
}

int bridge_link_fd(const bridge_link_t *self) {
    return self->epoll_fd;
}

bool bridge_link_ask(bridge_link_t *self, const char *request, bridge_answer_t answer, void *context, uint64_t now_us) {
    self->now_us = now_us;
    if (bridge_is_stop(request)) {
        return bridge_stop_ask(&self->stop, request, answer, context, now_us);
    }
    if (self->state != BRIDGE_LINK_HERE || self->count >= BRIDGE_ASKED_MAX || strlen(request) >= BRIDGE_REQUEST_SIZE) {
        return false;
    }
    bridge_question_t *question = &self->waits[self->count++];
    *question = (bridge_question_t){.until_us = now_us + BRIDGE_ANSWER_US, .answer = answer, .context = context};
    (void)snprintf(question->request, sizeof question->request, "%s", request);
    return true;
}

void bridge_link_rate(bridge_link_t *self, unsigned rate_hz, uint64_t now_us) {
    char request[128];
    if (rate_hz == self->terms.rate_hz) {
        return;
    }
    (void)snprintf(request, sizeof request, WATCH, rate_hz);
    if (self->line.state != BRIDGE_HERE || bridge_link_ask(self, request, NULL, NULL, now_us)) {
        self->terms.rate_hz = rate_hz; // Otherwise the next call tries again.
    }
}

void bridge_link_forget(bridge_link_t *self, const void *context) {
    bridge_stop_forget(&self->stop, context);
    bridge_line_forget(&self->line, context);
    for (unsigned i = self->count; i > 0U; i--) {
        if (self->waits[i - 1U].context == context) {
            (void)take_out(self, i - 1U);
        }
    }
}
