// SPDX-License-Identifier: MIT
#include "slots.h"

#include "log.h"

#include "iwheel_linux/clock.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

const sock_part_t sock_parts[SOCK_PARTS] = {
    [SOCK_DRIVE] = {0U, SOCK_DRIVERS_MAX},
    [SOCK_WATCH] = {SOCK_DRIVERS_MAX, SOCK_WATCHERS_MAX},
    [SOCK_STOP] = {SOCK_DRIVERS_MAX + SOCK_WATCHERS_MAX, SOCK_RIGHTS *SOCK_STOP_SLOTS},
};

void sock_service_note(sock_clients_t *self, const struct epoll_event *event) {
    sock_client_t *client = &self->client[event->data.u64 - SOCK_TAG_CLIENT];
    client->readable = (event->events & (EPOLLIN | EPOLLRDHUP)) != 0U;
    client->leaving = client->leaving || (event->events & (EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0U;
    client->hung_up = (event->events & (EPOLLHUP | EPOLLERR)) != 0U;
}

/// Executes the stop requests among the lines that were received but not executed, also those still in the socket.
static void read_last_lines(sock_clients_t *self, sock_client_t *client) {
    const char *line;
    size_t at;
    size_t length;
    unsigned lines = 0;
    unsigned reads = 0;
    do {
        at = 0;
        while (lines < SOCK_LAST_LINES && (line = sock_client_next_stop(client, &at, &length)) != NULL) {
            self->handler.carry_out(self->handler.context, client, line, length);
            lines++;
        }
    } while (lines < SOCK_LAST_LINES && reads++ < SOCK_LAST_READS && sock_client_read_on(client, at));
    client->in_length = 0;
}

void sock_service_finish(sock_clients_t *self, sock_client_t *client) {
    const iw_time_us_t until_us = client->close_us;
    sock_client_finish(client, self->now_us);
    if (client->right == SOCK_STOP) {
        client->close_us = until_us;
    }
    read_last_lines(self, client);
    self->handler.leave(self->handler.context, client);
}

void sock_service_release(sock_clients_t *self, sock_client_t *client) {
    sock_log(self->log, SOCK_LOG_DEBUG, "client %u (pid %d) closed", (unsigned)client->id, client->pid);
    (void)close(client->fd);
    client->id = IW_CLIENT_NONE;
    self->count[client->right]--;
    self->open[client->right] &=
        ~(UINT64_C(1) << ((uint32_t)(client - self->client) - sock_parts[client->right].first));
}

/// Closes the connection. The handler replies if there is a stop in the part that was read.
static void refuse_long_line(sock_clients_t *self, sock_client_t *client) {
    iwn_request_t request;
    iwn_refusal_t refusal;
    if (iwn_request_read(client->in, client->in_length, NULL, &request, &refusal)) {
        sock_client_finish(client, self->now_us);
        self->handler.carry_out(self->handler.context, client, client->in, client->in_length);
    } else {
        (void)snprintf(refusal.message, sizeof refusal.message,
                       "a request has at most %u bytes and ends with a newline; the connection is closed",
                       IWN_LINE_MAX);
        sock_clients_refuse(self, client, &request.id, &refusal);
    }
    sock_service_finish(self, client);
}

static bool has_line(const sock_client_t *client) {
    size_t length;
    return !sock_client_is_closing(client) && !client->held && !client->executed &&
           sock_client_line(client, &length) != NULL;
}

/// Returns true if a line of the client may be executed now. A client that has hung up is finished immediately.
static bool has_turn(const sock_clients_t *self, const sock_client_t *client) {
    const bool in_time = client->right != SOCK_WATCH || client->hung_up || self->now_us >= client->line_us;
    return in_time && has_line(client);
}

/// After a pause as many lines as fit into one turn are executed together.
static void pace(sock_client_t *client, iw_time_us_t now_us) {
    const iw_time_us_t saved_us = (iw_time_us_t)(SOCK_LINES_PER_CYCLE - 1U) * SOCK_WATCHER_LINE_US;
    const bool rested = now_us >= client->line_us + saved_us;
    client->line_us = (rested ? now_us - saved_us : client->line_us) + SOCK_WATCHER_LINE_US;
}

/// Returns the line to execute now. A watcher's lines wait for each other for long, so its stop requests go first.
static const char *next_line(const sock_clients_t *self, const sock_client_t *client, size_t *out_length) {
    const sock_handler_t *const handler = &self->handler;
    if (client->right == SOCK_WATCH && handler->stops != NULL) {
        const char *line;
        size_t at = 0;
        for (unsigned i = 0; i < SOCK_LAST_LINES && (line = sock_client_next_stop(client, &at, out_length)) != NULL;
             i++) {
            if (handler->stops(handler->context, line, *out_length)) {
                return line;
            }
        }
    }
    return sock_client_line(client, out_length);
}

/// Input of a watcher whose lines wait does not wake the loop, but a stop in it precedes the next of them.
static void read_lines(const sock_clients_t *self, sock_client_t *client) {
    const bool waits = client->right == SOCK_WATCH && has_turn(self, client);
    if (client->readable || client->hung_up || waits) {
        sock_client_read(client);
    }
}

static void carry_out_lines(sock_clients_t *self, sock_client_t *client) {
    for (unsigned i = 0; i < SOCK_LINES_PER_CYCLE && !sock_client_is_broken(client) && has_turn(self, client); i++) {
        size_t length;
        const char *line = next_line(self, client, &length);
        self->handler.carry_out(self->handler.context, client, line, length);
        sock_client_drop_line(client, line, length);
        client->executed = client->right == SOCK_STOP;
        pace(client, self->now_us);
    }
}

/// Returns true if nothing is left to do, except for a recording that it waits for and can receive.
static bool has_ended(const sock_client_t *client) {
    const bool waits = client->owed && !client->hung_up;
    return client->phase == SOCK_ENDED && (client->held || (!has_line(client) && !waits));
}

void sock_service_serve(sock_clients_t *self, sock_client_t *client) {
    if (client->leaving) {
        self->handler.leave(self->handler.context, client); // Immediately, whatever it has sent before.
    }
    read_lines(self, client);
    carry_out_lines(self, client);
    if (!sock_client_is_closing(client) && !client->held && sock_client_line_too_long(client)) {
        refuse_long_line(self, client);
    }
    const bool done = client->executed && !client->owed; // Its one line is answered.
    const bool over = client->phase == SOCK_BROKEN || done || has_ended(client);
    if (over && !sock_client_is_closing(client)) {
        sock_service_finish(self, client);
    }
    if (client->hung_up && client->phase == SOCK_CLOSING) {
        sock_client_break(client); // The peer no longer reads.
    }
    client->readable = false;
}

/// Serves a client in a round. Returns whether there was anything to do.
typedef bool (*service_t)(sock_clients_t *self, sock_client_t *client);

/// One round over all clients, and its progress.
typedef struct {
    service_t service;
    const sock_client_t *holder;
    iw_time_us_t end_us; ///< End of the time for all but the first; 0 until a client had anything to do.
} round_t;

/// Serves the clients with one right, from the end of their last round, until the time has expired. At least one is
/// served. Returns true if all were served.
static bool go_among(sock_clients_t *self, round_t *round, sock_right_t right, uint32_t *next) {
    const uint64_t behind = UINT64_MAX << *next;
    uint64_t left = self->open[right];
    bool worked = false;
    while (left != 0U) {
        const uint32_t slot = (uint32_t)__builtin_ctzll(((left & behind) != 0U) ? left & behind : left);
        left &= ~(UINT64_C(1) << slot);
        sock_client_t *client = &self->client[sock_parts[right].first + slot];
        const iw_time_us_t now_us = worked ? iwl_clock_now_us() : 0U;
        if (round->end_us == 0U && worked) {
            round->end_us = now_us + SOCK_ROUND_US;
        }
        if (worked && now_us >= round->end_us) {
            *next = slot;
            return false;
        }
        worked = (client != round->holder && round->service(self, client)) || worked;
    }
    return true;
}

/// Serves clients that may only stop, then the lease holder, then the others that may drive, then the watchers. Returns
/// true if all were served.
static bool go_round(sock_clients_t *self, iw_client_t holder_id, service_t service, uint32_t next[SOCK_PARTS]) {
    if ((self->open[SOCK_DRIVE] | self->open[SOCK_WATCH] | self->open[SOCK_STOP]) == 0U) {
        return true; // No client is connected, which is the usual case.
    }
    sock_client_t *holder = sock_clients_find(self, holder_id);
    round_t round = {.service = service, .holder = holder};
    const bool stops = go_among(self, &round, SOCK_STOP, &next[SOCK_STOP]);
    if (holder != NULL) {
        (void)service(self, holder);
    }
    const bool all = go_among(self, &round, SOCK_DRIVE, &next[SOCK_DRIVE]);
    return go_among(self, &round, SOCK_WATCH, &next[SOCK_WATCH]) && all && stops;
}

static bool serve_if_wanted(sock_clients_t *self, sock_client_t *client) {
    const bool wanted = client->readable || client->hung_up || has_turn(self, client);
    if (wanted) {
        sock_service_serve(self, client);
    }
    return wanted;
}

void sock_service_first(sock_clients_t *self, sock_client_t *client) {
    (void)serve_if_wanted(self, client);
}

void sock_service_clients(sock_clients_t *self, iw_client_t holder) {
    self->some_wait = !go_round(self, holder, serve_if_wanted, self->next_served);
    for (uint32_t i = sock_clients_from(self, 0U); i < SOCK_CLIENTS_MAX; i = sock_clients_from(self, i + 1U)) {
        sock_client_t *client = &self->client[i];
        if (!client->readable) {
            sock_client_note_caught_up(client, self->now_us);
        }
    }
    sock_service_poll_arrivals(self);
}

/// Watches for input unless there is no space or no use (a watcher whose next line must wait does not wake the loop
/// with more), and for output only while something is queued.
static void update_interest(sock_clients_t *self, sock_client_t *client) {
    const bool reading = client->phase == SOCK_OPEN && client->in_length < sizeof client->in &&
                         (client->right != SOCK_WATCH || !has_line(client));
    const uint32_t wanted =
        (reading ? (uint32_t)(EPOLLIN | EPOLLRDHUP) : 0U) | (sock_client_flushed(client) ? 0U : (uint32_t)EPOLLOUT);
    if (wanted == client->interest) {
        return;
    }
    struct epoll_event interest = {.events = wanted,
                                   .data = {.u64 = SOCK_TAG_CLIENT + (uint64_t)(client - self->client)}};
    client->interest = wanted;
    (void)epoll_ctl(self->epoll_fd, EPOLL_CTL_MOD, client->fd, &interest);
}

bool sock_service_flush_one(sock_clients_t *self, sock_client_t *client) {
    const bool waiting = !sock_client_flushed(client);
    sock_client_flush(client);
    if (client->phase == SOCK_BROKEN) {
        sock_service_finish(self, client);
    }
    if (sock_client_is_closing(client) && (sock_client_flushed(client) || self->now_us >= client->close_us)) {
        sock_service_release(self, client);
    } else {
        update_interest(self, client);
    }
    return waiting;
}

void sock_service_flush(sock_clients_t *self, iw_client_t holder) {
    self->lines_wait = !go_round(self, holder, sock_service_flush_one, self->next_flushed);
}

bool sock_service_is_busy(const sock_clients_t *self) {
    for (uint32_t i = sock_clients_from(self, 0U); i < SOCK_CLIENTS_MAX; i = sock_clients_from(self, i + 1U)) {
        if (has_turn(self, &self->client[i])) {
            return true;
        }
    }
    return self->some_wait || self->lines_wait;
}

iw_time_us_t sock_service_next_us(const sock_clients_t *self) {
    iw_time_us_t next_us = IW_NEVER;
    for (unsigned right = 0; right < SOCK_RIGHTS; right++) {
        const iw_time_us_t from_us = self->listener[right].from_us;
        if (from_us != 0U && from_us < next_us) {
            next_us = from_us;
        }
    }
    for (uint32_t i = sock_clients_from(self, 0U); i < SOCK_CLIENTS_MAX; i = sock_clients_from(self, i + 1U)) {
        const sock_client_t *client = &self->client[i];
        if ((sock_client_is_closing(client) || client->right == SOCK_STOP) && client->close_us < next_us) {
            next_us = client->close_us;
        }
        if (client->right == SOCK_WATCH && client->line_us < next_us && has_line(client)) {
            next_us = client->line_us;
        }
    }
    return next_us;
}

void sock_service_close_all(sock_clients_t *self) {
    for (uint32_t i = sock_clients_from(self, 0U); i < SOCK_CLIENTS_MAX; i = sock_clients_from(self, i + 1U)) {
        sock_service_release(self, &self->client[i]);
    }
}
