// SPDX-License-Identifier: MIT
#include "client.h"

#include "signals.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#define RETRY_US 20000

int64_t client_now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

void client_init(client_t *self) {
    memset(self, 0, sizeof(*self));
    self->socket = -1;
    self->line = "";
}

/// Waits for `events` on the connection (on nothing with `events` 0), signals let in.
static client_result_t await(client_t *self, short events, int64_t deadline_us) {
    const int64_t left_us = deadline_us - client_now_us();
    if (signals_count() != self->seen_signals) {
        return CLIENT_INTERRUPTED;
    }
    const struct timespec timeout = {left_us > 0 ? left_us / 1000000 : 0, left_us > 0 ? left_us % 1000000 * 1000 : 0};
    struct pollfd entry = {.fd = events != 0 ? self->socket : -1, .events = events};
    const int ready = ppoll(&entry, 1, &timeout, signals_let_in());
    if (ready > 0) {
        return CLIENT_OK;
    }
    if (ready < 0 && errno == EINTR) {
        return signals_count() != self->seen_signals ? CLIENT_INTERRUPTED : CLIENT_OK;
    }
    return ready == 0 ? CLIENT_TIMEOUT : CLIENT_CLOSED;
}

int client_open(client_t *self, const char *path, int64_t deadline_us) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof(address.sun_path)) {
        return ENAMETOOLONG;
    }
    memcpy(address.sun_path, path, strlen(path));
    self->socket = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (self->socket < 0) {
        return errno;
    }
    while (connect(self->socket, (const struct sockaddr *)&address, sizeof(address)) != 0) {
        const int error = errno;
        const int64_t now_us = client_now_us();
        if (error == EAGAIN && now_us < deadline_us) {
            (void)await(self, 0, now_us + RETRY_US);
        } else if (error != EINTR) {
            client_close(self);
            return error == EAGAIN ? ETIMEDOUT : error;
        }
    }
    return 0;
}

void client_close(client_t *self) {
    if (self->socket >= 0) {
        (void)close(self->socket);
    }
    self->socket = -1;
}

static client_result_t send_all(client_t *self, const char *text, int64_t deadline_us) {
    size_t left = strlen(text);
    while (left > 0) {
        const ssize_t sent = send(self->socket, text, left, MSG_NOSIGNAL);
        if (sent >= 0) {
            text += sent;
            left -= (size_t)sent;
            continue;
        }
        if (errno != EAGAIN && errno != EINTR) {
            return CLIENT_CLOSED;
        }
        const client_result_t result = await(self, POLLOUT, deadline_us);
        if (result != CLIENT_OK) {
            return result;
        }
    }
    return CLIENT_OK;
}

client_result_t client_send(client_t *self, json_t *request, int64_t deadline_us, int64_t *out_id) {
    char text[4097];
    *out_id = ++self->next_id;
    (void)json_object_set_new(request, "id", json_integer(*out_id));
    const size_t length = json_dumpb(request, text, sizeof(text) - 2U, JSON_COMPACT);
    json_decref(request);
    if (length == 0 || length > sizeof(text) - 2U) {
        return CLIENT_GARBLED;
    }
    text[length] = '\n';
    text[length + 1U] = '\0';
    return send_all(self, text, deadline_us);
}

/// Moves the next complete line to `self->line`; false if there is none yet.
static bool take_line(client_t *self) {
    char *begin = self->buffer + self->begin;
    char *newline = memchr(begin, '\n', self->end - self->begin);
    if (newline == NULL) {
        memmove(self->buffer, begin, self->end - self->begin);
        self->end -= self->begin;
        self->begin = 0;
        return false;
    }
    *newline = '\0';
    self->line = begin;
    self->begin = (size_t)(newline - self->buffer) + 1U;
    return true;
}

client_result_t client_receive(client_t *self, int64_t deadline_us, json_t **out_line) {
    *out_line = NULL;
    while (!take_line(self)) {
        if (self->end >= CLIENT_LINE_MAX + 1U) {
            return CLIENT_GARBLED;
        }
        const client_result_t result = await(self, POLLIN, deadline_us);
        if (result != CLIENT_OK) {
            return result;
        }
        const ssize_t got = recv(self->socket, self->buffer + self->end, CLIENT_LINE_MAX + 1U - self->end, 0);
        if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) {
            return CLIENT_CLOSED;
        }
        self->end += got > 0 ? (size_t)got : 0U;
    }
    *out_line = json_loads(self->line, JSON_REJECT_DUPLICATES, NULL);
    if (!json_is_object(*out_line)) {
        json_decref(*out_line);
        *out_line = NULL;
        return CLIENT_GARBLED;
    }
    return CLIENT_OK;
}

client_result_t client_wait(client_t *self, int64_t id, int64_t deadline_us, json_t **out_reply) {
    for (;;) {
        const client_result_t result = client_receive(self, deadline_us, out_reply);
        if (result != CLIENT_OK) {
            return result;
        }
        const json_t *its_id = json_object_get(*out_reply, "id");
        const bool is_reply = json_object_get(*out_reply, "ok") != NULL;
        if (is_reply && (!json_is_integer(its_id) || json_integer_value(its_id) == id)) {
            return CLIENT_OK;
        }
        json_decref(*out_reply);
        *out_reply = NULL;
    }
}
