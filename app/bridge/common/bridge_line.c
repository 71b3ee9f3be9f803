// SPDX-License-Identifier: MIT
#include "bridge_line.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/// Longest wait for the rest of a greeting in ms. The gateway writes the greeting in one call.
#define REST_MS 20

bool bridge_line_open(bridge_line_t *self, const char *socket, int epoll_fd) {
    *self = (bridge_line_t){
        .socket = socket, .epoll_fd = epoll_fd, .gateway = iwc_new(), .result = IWC_NOT_THERE, .greeting_fd = -1};
    return self->gateway != NULL;
}

void bridge_line_close(bridge_line_t *self) {
    if (self->gateway != NULL) {
        bridge_line_drop(self, IWC_CLOSED);
    }
    iwc_free(self->gateway);
    self->gateway = NULL;
}

static void answer(bridge_sent_t *place, const iwc_message_t *reply) {
    const bridge_sent_t sent = *place;
    place->id = 0; // Before the call, because the answer may send again.
    if (sent.answer != NULL) {
        sent.answer(sent.context, reply);
    }
}

void bridge_line_drop(bridge_line_t *self, iwc_result_t why) {
    if (self->greeting_fd >= 0) {
        (void)close(self->greeting_fd);
        self->greeting_fd = -1;
    }
    iwc_close(self->gateway); // This also removes the descriptor from the epoll set.
    self->state = BRIDGE_AWAY;
    self->result = why;
    for (size_t i = 0; i < BRIDGE_LINE_MAX; i++) {
        if (self->sent[i].id != 0) {
            answer(&self->sent[i], NULL);
        }
    }
}

static iwc_result_t meaning_of(int error) {
    if (error == EACCES || error == EPERM) {
        return IWC_DENIED;
    }
    return (error == EAGAIN) ? IWC_TIMEOUT : IWC_NOT_THERE;
}

/// Returns a connected descriptor in the epoll set; -1: `result` says why there is none.
static int dial(bridge_line_t *self) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int length = snprintf(address.sun_path, sizeof address.sun_path, "%s", self->socket);
    if (length < 0 || (size_t)length >= sizeof address.sun_path) {
        self->result = IWC_INVALID;
        return -1;
    }
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    struct epoll_event event = {.events = EPOLLIN};
    if (fd < 0 || connect(fd, (const struct sockaddr *)&address, sizeof address) != 0 ||
        epoll_ctl(self->epoll_fd, EPOLL_CTL_ADD, fd, &event) != 0) {
        self->result = meaning_of(errno);
        if (fd >= 0) {
            (void)close(fd);
        }
        return -1;
    }
    return fd;
}

bool bridge_line_connect(bridge_line_t *self, uint64_t now_us) {
    self->greeting_fd = dial(self);
    if (self->greeting_fd < 0) {
        return false;
    }
    self->greeting_until_us = now_us + BRIDGE_GREETING_US;
    self->state = BRIDGE_GREETING;
    return true;
}

bool bridge_line_connect_for_stop(bridge_line_t *self) {
    const int fd = dial(self);
    if (fd < 0) {
        return false;
    }
    (void)iwc_adopt_for_stop(self->gateway, fd); // It fails for a bad descriptor only.
    self->state = BRIDGE_HERE;
    return true;
}

bridge_line_state_t bridge_line_greet(bridge_line_t *self, uint64_t now_us) {
    char byte = 0;
    if (self->state != BRIDGE_GREETING) {
        return self->state;
    }
    const ssize_t there = recv(self->greeting_fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
    if (there < 0 && (errno == EAGAIN || errno == EINTR)) {
        if (now_us >= self->greeting_until_us) {
            bridge_line_drop(self, IWC_TIMEOUT);
        }
        return self->state;
    }
    const int fd = self->greeting_fd;
    self->greeting_fd = -1;
    const iwc_result_t result = iwc_adopt(self->gateway, fd, REST_MS); // On failure iwc_adopt closes the descriptor.
    if (result == IWC_OK || result == IWC_NEWER) {
        self->state = BRIDGE_HERE;
    } else {
        bridge_line_drop(self, result);
    }
    return self->state;
}

iwc_result_t bridge_line_send(bridge_line_t *self, const char *request, const bridge_sent_t *sent) {
    if (self->state != BRIDGE_HERE) {
        return IWC_CLOSED;
    }
    for (size_t i = 0; i < BRIDGE_LINE_MAX; i++) {
        if (self->sent[i].id != 0) {
            continue;
        }
        int64_t id = 0;
        const iwc_result_t result = iwc_send(self->gateway, request, 0, &id);
        if (result == IWC_OK) {
            self->sent[i] = *sent;
            self->sent[i].id = id;
        }
        return result;
    }
    return IWC_FULL;
}

static void take_reply(bridge_line_t *self, const iwc_message_t *message) {
    for (size_t i = 0; i < BRIDGE_LINE_MAX; i++) {
        if (message->id != 0 && self->sent[i].id == message->id) {
            answer(&self->sent[i], message);
            return;
        }
    }
}

bool bridge_line_next(bridge_line_t *self, iwc_message_t *out_event) {
    while (self->state == BRIDGE_HERE) {
        const iwc_result_t result = iwc_next(self->gateway, 0, out_event);
        if (result == IWC_OK && out_event->is_event) {
            return true;
        }
        if (result == IWC_OK) {
            take_reply(self, out_event);
            continue;
        }
        if (result == IWC_CLOSED || result == IWC_GARBLED) {
            bridge_line_drop(self, result);
        }
        return false;
    }
    return false;
}

unsigned bridge_line_expire(bridge_line_t *self, uint64_t now_us) {
    unsigned count = 0;
    for (size_t i = 0; i < BRIDGE_LINE_MAX; i++) {
        if (self->sent[i].id != 0 && now_us >= self->sent[i].until_us) {
            answer(&self->sent[i], NULL);
            count++;
        }
    }
    return count;
}

void bridge_line_forget(bridge_line_t *self, const void *context) {
    for (size_t i = 0; i < BRIDGE_LINE_MAX; i++) {
        if (self->sent[i].context == context) {
            self->sent[i].answer = NULL;
        }
    }
}

uint64_t bridge_line_next_us(const bridge_line_t *self, uint64_t now_us) {
    uint64_t next_us = (self->state == BRIDGE_GREETING) ? self->greeting_until_us : UINT64_MAX;
    for (size_t i = 0; i < BRIDGE_LINE_MAX; i++) {
        if (self->sent[i].id != 0 && self->sent[i].until_us < next_us) {
            next_us = self->sent[i].until_us;
        }
    }
    return (self->state == BRIDGE_HERE && iwc_pending(self->gateway)) ? now_us : next_us;
}

unsigned bridge_line_in_flight(const bridge_line_t *self) {
    unsigned count = 0;
    for (size_t i = 0; i < BRIDGE_LINE_MAX; i++) {
        count += (self->sent[i].id != 0) ? 1U : 0U;
    }
    return count;
}
