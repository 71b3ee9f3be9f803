// SPDX-License-Identifier: MIT
#include "serial_queue.h"

#include <string.h>

serial_kind_t serial_kind_of(iwn_cmd_t cmd) {
    switch (cmd) {
    case IWN_CMD_DRIVE:
    case IWN_CMD_TWIST:
        return SERIAL_MOVES;
    case IWN_CMD_STOP:
    case IWN_CMD_DISARM:
    case IWN_CMD_ESTOP:
        return SERIAL_STOPS;
    default:
        return iwn_cmd_watches(cmd) ? SERIAL_ASKS : SERIAL_GRANTS;
    }
}

bool serial_has_age(iwn_cmd_t cmd) {
    return cmd == IWN_CMD_ARM || cmd == IWN_CMD_RESET || cmd == IWN_CMD_RELEASE || cmd == IWN_CMD_CONFIRM;
}

void serial_queue_init(serial_queue_t *self, uint64_t hold_us) {
    memset(self, 0, sizeof *self);
    self->hold_us = hold_us;
}

bool serial_queue_is_full(const serial_queue_t *self) {
    return self->count == SERIAL_QUEUE_SIZE;
}

/// Returns the request at this place, counted from the oldest.
static serial_request_t *at(serial_queue_t *self, unsigned index) {
    return &self->ring[(self->first + index) % SERIAL_QUEUE_SIZE];
}

serial_request_t *serial_queue_place(serial_queue_t *self) {
    return at(self, self->count);
}

static void refuse(serial_request_t *request, iwn_error_t error, const char *reason) {
    request->state = SERIAL_ANSWERED;
    request->error = error;
    request->reason = reason;
}

void serial_queue_overtake(serial_queue_t *self, serial_kind_t newer) {
    for (unsigned i = 0; i < self->count; i++) {
        serial_request_t *request = at(self, i);
        if (request->state != SERIAL_WAITING) {
            continue;
        }
        if (request->kind == SERIAL_MOVES && newer == SERIAL_MOVES) {
            refuse(request, IWN_STALE_COMMAND,
                   "a newer command of this client replaced this one before the serial line was free; send no faster "
                   "than the replies come");
        } else if (newer == SERIAL_STOPS && (request->kind == SERIAL_MOVES || request->kind == SERIAL_GRANTS)) {
            refuse(request, IWN_STALE_COMMAND, SERIAL_OVERTAKEN);
        }
    }
}

void serial_queue_put(serial_queue_t *self) {
    const serial_request_t *request = at(self, self->count);
    if (request->state == SERIAL_WAITING || request->kind == SERIAL_STOPS) {
        serial_queue_overtake(self, request->kind);
    }
    self->count++;
}

/// Returns the longest time in the state of a request.
static uint64_t limit_us(const serial_request_t *request) {
    if (request->state == SERIAL_WAITING && request->kind != SERIAL_ASKS) {
        return (request->kind == SERIAL_MOVES) ? SERIAL_FRESH_US : SERIAL_GRANT_US;
    }
    return (request->kind == SERIAL_MOVES) ? SERIAL_MOVE_PATIENCE_US : SERIAL_PATIENCE_US;
}

static uint64_t since_us(const serial_request_t *request) {
    return (request->state == SERIAL_WAITING) ? request->came_us : request->sent_us;
}

static void give_up(serial_request_t *request) {
    if (request->state == SERIAL_WAITING) {
        refuse(request, IWN_STALE_COMMAND,
               "this request waited too long for the serial line and was not sent; use a higher baud rate");
    } else if (request->kind == SERIAL_MOVES) {
        refuse(request, IWN_STALE_COMMAND,
               "the board did not answer in time: this command or its reply was lost on the serial line; send a new "
               "command");
    } else {
        refuse(request, IWN_INTERNAL, SERIAL_NO_REPLY);
    }
}

void serial_queue_age(serial_queue_t *self, uint64_t now_us) {
    for (unsigned i = 0; i < self->count; i++) {
        serial_request_t *request = at(self, i);
        if (request->state < SERIAL_HELD && now_us >= since_us(request) + limit_us(request)) {
            self->unanswered += (request->state == SERIAL_SENT) ? 1U : 0U;
            give_up(request);
        }
    }
}

/// Returns the time at which a request changes its state without input.
static uint64_t turn_us(const serial_queue_t *self, const serial_request_t *request, uint64_t now_us) {
    const uint64_t held_us = request->sent_us + self->hold_us;
    if (request->state == SERIAL_SENT && request->kind == SERIAL_MOVES && held_us > now_us) {
        return held_us;
    }
    return (request->state < SERIAL_HELD) ? since_us(request) + limit_us(request) : UINT64_MAX;
}

uint64_t serial_queue_next_us(const serial_queue_t *self, uint64_t now_us) {
    uint64_t next_us = UINT64_MAX;
    for (unsigned i = 0; i < self->count; i++) {
        const uint64_t then_us = turn_us(self, &self->ring[(self->first + i) % SERIAL_QUEUE_SIZE], now_us);
        if (then_us < next_us) {
            next_us = then_us;
        }
    }
    return next_us;
}

/// Returns true for a `drive` that has been on the line for this time.
static bool holds_no_more(const serial_queue_t *self, const serial_request_t *request, uint64_t now_us) {
    return request->kind == SERIAL_MOVES && now_us >= request->sent_us + self->hold_us;
}

serial_request_t *serial_queue_next(serial_queue_t *self, uint64_t now_us) {
    bool unanswered = false;
    for (unsigned i = 0; i < self->count && !unanswered; i++) {
        serial_request_t *request = at(self, i);
        if (request->state == SERIAL_WAITING) {
            return request;
        }
        unanswered = request->state == SERIAL_SENT && !holds_no_more(self, request, now_us);
    }
    return NULL;
}

void serial_queue_sent(serial_request_t *request, uint64_t now_us) {
    if (request->state != SERIAL_SENT) {
        request->sent_us = now_us;
    }
    request->tried_us = now_us;
    request->state = SERIAL_SENT;
}

const serial_request_t *serial_queue_answered(const serial_queue_t *self) {
    const serial_request_t *oldest = &self->ring[self->first];
    return (self->count > 0U && oldest->state >= SERIAL_HELD) ? oldest : NULL;
}

void serial_queue_drop(serial_queue_t *self) {
    self->first = (self->first + 1U) % SERIAL_QUEUE_SIZE;
    self->count--;
}

/// Gives up commands before the request at this place. The board replies to a command at once, so the reply to a later
/// request shows that theirs are lost, and each of them would use a place until then.
static void give_up_before(serial_queue_t *self, unsigned index) {
    for (unsigned i = 0; i < index; i++) {
        serial_request_t *request = at(self, i);
        if (request->state == SERIAL_SENT && request->kind == SERIAL_MOVES) {
            give_up(request);
        }
    }
}

bool serial_queue_take(serial_queue_t *self, uint64_t number, bool ok, const char *rest, size_t length) {
    unsigned index = 0;
    while (index < self->count && (at(self, index)->number != number || at(self, index)->state != SERIAL_SENT)) {
        index++;
    }
    if (index == self->count) {
        return false;
    }
    serial_request_t *request = at(self, index);
    self->unanswered = 0;
    request->ok = ok;
    give_up_before(self, index);
    if (index > 0U) {
        serial_request_hold(request, rest, length);
    }
    return true;
}

void serial_request_hold(serial_request_t *request, const char *rest, size_t length) {
    if (length <= sizeof request->json) {
        request->state = SERIAL_HELD;
        request->length = length;
        memcpy(request->json, rest, length);
    } else {
        refuse(request, IWN_INTERNAL,
               "the board replied out of order with more data than the relay stores; send the request again");
    }
}
