// SPDX-License-Identifier: MIT
#include "ctl_client.h"

#include <limits.h>
#include <stddef.h>
#include <stdlib.h>
#include <time.h>

int64_t client_now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

/// Returns the time that is left, rounded up: a wait that ends too early would be repeated without need.
static int left_ms(int64_t deadline_us) {
    const int64_t left_us = deadline_us - client_now_us();
    const int64_t ms = (left_us > 0) ? (left_us - 1) / 1000 + 1 : 0;
    return (ms < INT_MAX) ? (int)ms : INT_MAX;
}

bool client_init(client_t *self) {
    *self = (client_t){.gateway = iwc_new(), .line = ""};
    return self->gateway != NULL;
}

void client_free(client_t *self) {
    iwc_free(self->gateway);
    self->gateway = NULL;
}

iwc_result_t client_open(client_t *self, const char *path, int64_t deadline_us) {
    iwc_let_in(self->gateway, signals_let_in());
    iwc_result_t result = iwc_connect(self->gateway, path, left_ms(deadline_us));
    while (result == IWC_INTERRUPTED && signals_count() == self->seen_signals) {
        result = iwc_connect(self->gateway, path, left_ms(deadline_us));
    }
    if (result == IWC_NEWER) {
        result = IWC_OK;
    }
    self->open = result == IWC_OK;
    return result;
}

void client_close(client_t *self) {
    iwc_close(self->gateway);
    self->open = false;
    self->line = "";
}

iwc_result_t client_send(client_t *self, json_t *request, int64_t deadline_us, int64_t *out_id) {
    char *text = json_dumps(request, JSON_COMPACT);
    json_decref(request);
    iwc_let_in(self->gateway, signals_let_in());
    iwc_result_t result = IWC_INVALID;
    do {
        result = (text != NULL) ? iwc_send(self->gateway, text, left_ms(deadline_us), out_id) : IWC_INVALID;
    } while (result == IWC_INTERRUPTED && signals_count() == self->seen_signals);
    free(text);
    return result;
}

iwc_result_t client_receive(client_t *self, int64_t deadline_us, json_t **out_line) {
    iwc_message_t message;
    iwc_result_t result = IWC_INTERRUPTED;
    *out_line = NULL;
    iwc_let_in(self->gateway, signals_let_in());
    while (result == IWC_INTERRUPTED && signals_count() == self->seen_signals) {
        result = iwc_next(self->gateway, left_ms(deadline_us), &message);
    }
    if (result != IWC_OK) {
        return result;
    }
    self->line = message.text;
    self->skipped += message.skipped;
    *out_line = json_loadb(message.text, message.length, JSON_REJECT_DUPLICATES, NULL);
    return (*out_line != NULL) ? IWC_OK : IWC_GARBLED;
}

/// Receives until the reply to `id` arrives. Drops events and replies to other requests. Accepts a reply without id too:
/// it refuses the whole connection or a line.
static iwc_result_t client_wait(client_t *self, int64_t id, int64_t deadline_us, json_t **out_reply) {
    for (;;) {
        const iwc_result_t result = client_receive(self, deadline_us, out_reply);
        if (result != IWC_OK) {
            return result;
        }
        const json_t *its_id = json_object_get(*out_reply, "id");
        const bool is_reply = json_object_get(*out_reply, "ok") != NULL;
        if (is_reply && (!json_is_integer(its_id) || json_integer_value(its_id) == id)) {
            return IWC_OK;
        }
        json_decref(*out_reply);
        *out_reply = NULL;
    }
}

iwc_result_t client_ask(client_t *self, json_t *request, json_t **out_reply) {
    int64_t id = 0;
    const int64_t deadline_us = client_now_us() + CLIENT_REPLY_US;
    *out_reply = NULL;
    const iwc_result_t result = client_send(self, request, deadline_us, &id);
    return (result == IWC_OK) ? client_wait(self, id, deadline_us, out_reply) : result;
}

// A signal handler has no argument for a context, so these three cannot be in a struct.
static volatile sig_atomic_t caught;
static bool catching;
static sigset_t let_in;

static void count(int signal_number) {
    (void)signal_number;
    caught = caught + 1;
}

void signals_catch(void) {
    struct sigaction action = {.sa_handler = count};
    sigset_t blocked;
    (void)sigemptyset(&blocked);
    const int caught_signals[] = {SIGINT, SIGTERM, SIGHUP};
    for (size_t i = 0; i < sizeof caught_signals / sizeof caught_signals[0]; i++) {
        (void)sigaddset(&blocked, caught_signals[i]);
        (void)sigaction(caught_signals[i], &action, NULL);
    }
    (void)sigprocmask(SIG_BLOCK, &blocked, &let_in);
    for (size_t i = 0; i < sizeof caught_signals / sizeof caught_signals[0]; i++) {
        (void)sigdelset(&let_in, caught_signals[i]);
    }
    catching = true;
}

unsigned signals_count(void) {
    return (unsigned)caught;
}

const sigset_t *signals_let_in(void) {
    return catching ? &let_in : NULL;
}
