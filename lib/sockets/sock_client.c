// SPDX-License-Identifier: MIT
#include "sock_client.h"

#include "iwheel_northbound/json_out.h"

#include <errno.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

void sock_client_read(sock_client_t *self) {
    const size_t space = sizeof self->in - self->in_length;
    if (space == 0U || self->phase != SOCK_OPEN) {
        return;
    }
    const ssize_t count = recv(self->fd, &self->in[self->in_length], space, MSG_DONTWAIT);
    self->drained = count < (ssize_t)space;
    if (count > 0) {
        self->in_length += (size_t)count;
    } else if (count == 0) {
        self->phase = SOCK_ENDED;
    } else if (count < 0 && errno != EAGAIN && errno != EINTR) {
        sock_client_break(self);
    }
}

const char *sock_client_line(const sock_client_t *self, size_t *out_length) {
    const char *end = (const char *)memchr(self->in, '\n', self->in_length);
    if (end == NULL) {
        return NULL;
    }
    *out_length = (size_t)(end - self->in);
    return self->in;
}

/// Returns true if the line may be a stop request. Other lines need not be read.
static bool may_stop(const char *line, size_t length) {
    return memmem(line, length, "stop", 4U) != NULL || memmem(line, length, "disarm", 6U) != NULL;
}

const char *sock_client_next_stop(const sock_client_t *self, size_t *at, size_t *out_length) {
    const char *line = &self->in[*at];
    const char *end;
    while ((end = (const char *)memchr(line, '\n', self->in_length - *at)) != NULL) {
        *out_length = (size_t)(end - line);
        *at += *out_length + 1U;
        if (may_stop(line, *out_length)) {
            return line;
        }
        line = end + 1;
    }
    return NULL;
}

void sock_client_drop_line(sock_client_t *self, const char *line, size_t length) {
    const size_t begin = (size_t)(line - self->in);
    const size_t end = begin + length + 1U;
    memmove(&self->in[begin], &self->in[end], self->in_length - end);
    self->in_length -= length + 1U;
}

bool sock_client_read_on(sock_client_t *self, size_t searched) {
    const size_t rest = self->in_length - searched;
    memmove(self->in, &self->in[searched], rest);
    self->in_length = (rest < sizeof self->in) ? rest : 0U; // Without a newline in all of it, it is no request.
    const ssize_t count = recv(self->fd, &self->in[self->in_length], sizeof self->in - self->in_length, MSG_DONTWAIT);
    self->in_length += (count > 0) ? (size_t)count : 0U;
    return count > 0;
}

void sock_client_note_caught_up(sock_client_t *self, iw_time_us_t then_us) {
    size_t length;
    if (then_us > self->caught_up_us && self->drained && sock_client_line(self, &length) == NULL) {
        self->caught_up_us = then_us;
    }
}

void sock_client_check_caught_up(sock_client_t *self, iw_time_us_t now_us) {
    int waiting = 0;
    if (ioctl(self->fd, FIONREAD, &waiting) == 0 && waiting == 0) {
        self->drained = true;
        sock_client_note_caught_up(self, now_us);
    }
}

iw_time_us_t sock_client_sent_us(const sock_client_t *self, iw_time_us_t now_us, iw_time_us_t since_us) {
    const bool prompt = now_us - self->caught_up_us <= SOCK_PROMPT_US && self->caught_up_us >= since_us;
    return prompt ? now_us : self->caught_up_us;
}

bool sock_client_waited_through_stop(const sock_client_t *self) {
    return self->caught_up_us < self->stopped_us;
}

bool sock_client_line_too_long(const sock_client_t *self) {
    return self->in_length == sizeof self->in && memchr(self->in, '\n', sizeof self->in) == NULL;
}

static bool queue(sock_client_t *self, const char *line, size_t length, size_t reserve) {
    const size_t waiting = self->out_end - self->out_start;
    if (length + reserve > sizeof self->out - waiting) {
        return false;
    }
    if (length > sizeof self->out - self->out_end) {
        memmove(self->out, &self->out[self->out_start], waiting);
        self->out_start = 0;
        self->out_end = waiting;
    }
    memcpy(&self->out[self->out_end], line, length);
    self->out_end += length;
    return true;
}

void sock_client_reply(sock_client_t *self, const char *line, size_t length) {
    if (!sock_client_is_broken(self) && !queue(self, line, length, 0U)) {
        sock_client_break(self);
    }
}

static bool report_lost(sock_client_t *self) {
    char line[64];
    iwn_out_t json;
    iwn_out_init(&json, line, sizeof line);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "event", "lost");
    iwn_out_int(&json, "count", self->lost);
    iwn_out_close(&json, '}');
    return queue(self, line, iwn_out_finish(&json), SOCK_REPLY_MAX);
}

void sock_client_event(sock_client_t *self, const char *line, size_t length) {
    if (self->phase != SOCK_OPEN) {
        return;
    }
    if (self->lost > 0U && report_lost(self)) {
        self->lost = 0;
    }
    if (self->lost > 0U || !queue(self, line, length, SOCK_REPLY_MAX)) {
        self->lost++;
    }
}

void sock_client_flush(sock_client_t *self) {
    if (sock_client_is_broken(self) || self->out_start == self->out_end) {
        return;
    }
    const ssize_t count =
        send(self->fd, &self->out[self->out_start], self->out_end - self->out_start, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count > 0) {
        self->out_start += (size_t)count;
    } else if (count < 0 && errno != EAGAIN && errno != EINTR) {
        sock_client_break(self);
    }
    if (self->out_start == self->out_end) {
        self->out_start = 0;
        self->out_end = 0;
    }
}

bool sock_client_flushed(const sock_client_t *self) {
    return sock_client_is_broken(self) || self->out_start == self->out_end;
}

void sock_client_break(sock_client_t *self) {
    self->phase = sock_client_is_closing(self) ? SOCK_GONE : SOCK_BROKEN;
}

void sock_client_finish(sock_client_t *self, iw_time_us_t now_us) {
    if (!sock_client_is_closing(self)) {
        self->phase = (self->phase == SOCK_BROKEN) ? SOCK_GONE : SOCK_CLOSING;
        self->close_us = now_us + SOCK_CLOSING_US;
    }
}
