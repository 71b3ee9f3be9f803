// SPDX-License-Identifier: MIT
#include "clients.h"

#include "process/log.h"

#include "iwheel_linux/clock.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

static void welcome(gw_clients_t *self, gw_client_t *client, int fd) {
    struct ucred peer = {0};
    socklen_t length = sizeof peer;
    (void)getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &length);
    const size_t slot = (size_t)(client - self->client);
    struct epoll_event interest = {.events = EPOLLIN | EPOLLRDHUP, .data = {.u64 = GW_TAG_CLIENT + slot}};
    if (epoll_ctl(self->epoll_fd, EPOLL_CTL_ADD, fd, &interest) != 0) {
        (void)close(fd);
        return;
    }
    memset(client, 0, offsetof(gw_client_t, in));
    client->id = ++self->last_id;
    client->fd = fd;
    client->pid = (int)peer.pid;
    client->uid = peer.uid;
    client->right = (slot < GW_DRIVERS_MAX) ? GW_DRIVE : GW_WATCH;
    client->interest = interest.events;
    client->rate_hz = IWN_RATE_DEFAULT_HZ;
    client->drained = true;
    client->caught_up_us = self->now_us;
    self->count[client->right]++;
    self->open[client->right] |= UINT64_C(1) << (slot % GW_DRIVERS_MAX);
    gw_log(self->log, GW_LOG_DEBUG, "client %u (pid %d) connected", (unsigned)client->id, client->pid);
    self->servant.welcome(self->servant.context, client);
}

static void turn_away(gw_clients_t *self, gw_listener_t *listener, int fd) {
    const iwn_id_t nobody = {.kind = IWN_ID_NONE};
    iwn_refusal_t refusal = {.error = IWN_TOO_MANY_CLIENTS};
    (void)snprintf(refusal.message, sizeof refusal.message,
                   "%u %s are connected and there is no room for more; close one, or raise %s and the limit of open "
                   "files",
                   (unsigned)self->count[listener->wish.right],
                   (listener->wish.right == GW_DRIVE) ? "clients" : "watchers",
                   (listener->wish.right == GW_DRIVE) ? "max_clients" : "max_watchers");
    const size_t length = gw_clients_write_refusal(self, &nobody, &refusal);
    (void)send(fd, self->line, length, MSG_DONTWAIT | MSG_NOSIGNAL);
    (void)close(fd);
    if (!listener->full_told) {
        gw_log(self->log, GW_LOG_WARNING, "a client was turned away: %s", refusal.message);
    }
    listener->full_told = listener->wish.right == GW_WATCH; // A flood of these must not crowd out other messages.
}

/// Of the table, by right.
static const struct {
    uint32_t first;
    uint32_t slots;
} part[GW_RIGHTS] = {[GW_DRIVE] = {0U, GW_DRIVERS_MAX}, [GW_WATCH] = {GW_DRIVERS_MAX, GW_WATCHERS_MAX}};

static gw_client_t *free_slot(gw_clients_t *self, gw_right_t right) {
    for (uint32_t i = 0; i < part[right].slots && self->count[right] < self->most[right]; i++) {
        gw_client_t *client = &self->client[part[right].first + i];
        if (client->id == IW_CLIENT_NONE) {
            return client;
        }
    }
    return NULL;
}

/// Whether a listening socket wakes the loop.
static void listen_to_newcomers(gw_clients_t *self, const gw_listener_t *listener, bool wanted) {
    const uint64_t tag = (listener->wish.right == GW_DRIVE) ? GW_TAG_LISTENER : GW_TAG_WATCH_LISTENER;
    struct epoll_event interest = {.events = wanted ? EPOLLIN : 0U, .data = {.u64 = tag}};
    (void)epoll_ctl(self->epoll_fd, EPOLL_CTL_MOD, listener->fd, &interest);
}

static void pause_listening(gw_clients_t *self, gw_listener_t *listener, iw_time_us_t pause_us) {
    listener->from_us = self->now_us + pause_us;
    listen_to_newcomers(self, listener, false);
}

/// Takes one newcomer. False: there is none, or none for now.
static bool accept_one(gw_clients_t *self, gw_listener_t *listener) {
    int fd;
    const gw_accept_t result = gw_listener_accept(listener, &fd);
    gw_client_t *client = (result == GW_ACCEPT_ONE) ? free_slot(self, listener->wish.right) : NULL;
    if (result == GW_ACCEPT_NONE) {
        return false;
    }
    if (result == GW_ACCEPT_PAUSE) {
        gw_log(self->log, GW_LOG_WARNING, "cannot accept clients for want of descriptors; trying again in %u ms",
               GW_LISTENER_PAUSE_US / IW_US_PER_MS);
        pause_listening(self, listener, GW_LISTENER_PAUSE_US);
        return false;
    }
    if (client != NULL) {
        listener->full_told = false;
        welcome(self, client, fd);
    } else {
        turn_away(self, listener, fd);
    }
    return true;
}

void gw_service_accept(gw_clients_t *self) {
    gw_listener_t *watch = &self->listener[GW_WATCH];
    for (unsigned i = 0; i < GW_ACCEPTS_PER_CYCLE && accept_one(self, &self->listener[GW_DRIVE]); i++) {
    }
    if (watch->fd >= 0 && watch->from_us == 0U && accept_one(self, watch)) {
        pause_listening(self, watch, GW_WATCHER_ACCEPT_US);
    }
}

/// Whoever has gone holds no lease any more, and is closed when it has taken what is left for it.
static void finish(gw_clients_t *self, gw_client_t *client) {
    self->servant.leave(self->servant.context, client);
    gw_client_finish(client, self->now_us);
}

static void release(gw_clients_t *self, gw_client_t *client) {
    gw_log(self->log, GW_LOG_DEBUG, "client %u (pid %d) closed", (unsigned)client->id, client->pid);
    (void)close(client->fd);
    client->id = IW_CLIENT_NONE;
    client->topics = 0;
    self->count[client->right]--;
    self->open[client->right] &= ~(UINT64_C(1) << ((size_t)(client - self->client) % GW_DRIVERS_MAX));
}

static void refuse_long_line(gw_clients_t *self, gw_client_t *client) {
    const iwn_id_t nobody = {.kind = IWN_ID_NONE};
    iwn_refusal_t refusal = {.error = IWN_LINE_TOO_LONG};
    (void)snprintf(refusal.message, sizeof refusal.message,
                   "a request has at most %u bytes and ends with a newline; the connection is closed", IWN_LINE_MAX);
    gw_clients_refuse(self, client, &nobody, &refusal);
    finish(self, client);
}

static bool has_line(const gw_client_t *client) {
    size_t length;
    return !client->closing && !client->arming && gw_client_line(client, &length) != NULL;
}

/// A line of it may be carried out now. One that has hung up is done with at once.
static bool has_turn(const gw_clients_t *self, const gw_client_t *client) {
    const bool in_time = client->right == GW_DRIVE || client->hung_up || self->now_us >= client->line_us;
    return in_time && has_line(client);
}

/// After a pause as many as fit into one turn are carried out together.
static void pace(gw_client_t *client, iw_time_us_t now_us) {
    const iw_time_us_t saved_us = (iw_time_us_t)(GW_LINES_PER_CYCLE - 1U) * GW_WATCHER_LINE_US;
    const bool rested = now_us >= client->line_us + saved_us;
    client->line_us = (rested ? now_us - saved_us : client->line_us) + GW_WATCHER_LINE_US;
}

static void carry_out_lines(gw_clients_t *self, gw_client_t *client) {
    for (unsigned i = 0; i < GW_LINES_PER_CYCLE && !client->failed && has_turn(self, client); i++) {
        size_t length;
        const char *line = gw_client_line(client, &length);
        self->servant.carry_out(self->servant.context, client, line, length);
        gw_client_drop_line(client, length);
        pace(client, self->now_us);
    }
}

/// Nothing of it is left to be done, but for a recording that it waits for and can take.
static bool has_ended(const gw_client_t *client) {
    const bool waits = client->reading && !client->hung_up;
    return client->ended && (client->arming || (!has_line(client) && !waits));
}

static void serve(gw_clients_t *self, gw_client_t *client) {
    if (client->leaving) {
        self->servant.leave(self->servant.context, client); // At once, whatever it has sent before.
    }
    if (client->readable || client->hung_up) {
        gw_client_read(client);
    }
    carry_out_lines(self, client);
    if (!client->closing && !client->arming && gw_client_line_too_long(client)) {
        refuse_long_line(self, client);
    }
    const bool gone = client->failed || has_ended(client);
    if (gone && !client->closing) {
        finish(self, client);
    }
    if (client->hung_up && client->closing) {
        client->failed = true; // Nobody reads any more.
    }
    client->readable = false;
}

/// Somebody served in a round, and whether there was anything to do.
typedef bool (*service_t)(gw_clients_t *self, gw_client_t *client);

/// One round of all, and how far it came.
typedef struct {
    service_t service;
    const gw_client_t *holder;
    iw_time_us_t end_us; ///< Of the time for all but the first; 0: nobody had anything to do yet.
} round_t;

/// Those with one right, from where their last round ended, until the time is up. At least one of them is served. True if all
/// were.
static bool go_among(gw_clients_t *self, round_t *round, gw_right_t right, uint32_t *next) {
    const uint64_t behind = UINT64_MAX << *next;
    uint64_t left = self->open[right];
    bool worked = false;
    while (left != 0U) {
        const uint32_t slot = (uint32_t)__builtin_ctzll(((left & behind) != 0U) ? left & behind : left);
        left &= ~(UINT64_C(1) << slot);
        gw_client_t *client = &self->client[part[right].first + slot];
        const iw_time_us_t now_us = worked ? iw_clock_now_us() : 0U;
        round->end_us = (round->end_us == 0U && worked) ? now_us + GW_ROUND_US : round->end_us;
        if (worked && now_us >= round->end_us) {
            *next = slot;
            return false;
        }
        worked = (client != round->holder && round->service(self, client)) || worked;
    }
    return true;
}

/// The holder of the lease first, then who else may drive, then the watchers. True if all were served.
static bool go_round(gw_clients_t *self, iw_client_t holder_id, service_t service, uint32_t next[GW_RIGHTS]) {
    if ((self->open[GW_DRIVE] | self->open[GW_WATCH]) == 0U) {
        return true; // Nobody is connected: most of a gateway's life.
    }
    gw_client_t *holder = gw_clients_find(self, holder_id);
    round_t round = {.service = service, .holder = holder};
    if (holder != NULL) {
        (void)service(self, holder);
    }
    const bool all = go_among(self, &round, GW_DRIVE, &next[GW_DRIVE]);
    return go_among(self, &round, GW_WATCH, &next[GW_WATCH]) && all;
}

static bool serve_if_wanted(gw_clients_t *self, gw_client_t *client) {
    const bool wanted = client->readable || client->hung_up || has_turn(self, client);
    if (wanted) {
        serve(self, client);
    }
    return wanted;
}

void gw_service_first(gw_clients_t *self, gw_client_t *client) {
    (void)serve_if_wanted(self, client);
}

void gw_service_clients(gw_clients_t *self, iw_client_t holder) {
    self->some_wait = !go_round(self, holder, serve_if_wanted, self->next_served);
    for (uint32_t i = gw_clients_from(self, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(self, i + 1U)) {
        gw_client_t *client = &self->client[i];
        if (!client->readable) {
            gw_client_note_caught_up(client, self->now_us);
        }
    }
    for (unsigned right = 0; right < GW_RIGHTS; right++) {
        gw_listener_t *listener = &self->listener[right];
        if (listener->from_us != 0U && self->now_us >= listener->from_us) {
            listener->from_us = 0;
            listen_to_newcomers(self, listener, true);
        }
    }
}

/// Reading is wanted unless there is no room or no use (a watcher whose next line has to wait wakes nobody with more of them);
/// writing only while something waits.
static void update_interest(gw_clients_t *self, gw_client_t *client) {
    const bool reading = !client->closing && !client->ended && client->in_length < sizeof client->in &&
                         (client->right == GW_DRIVE || !has_line(client));
    const uint32_t wanted =
        (reading ? (uint32_t)(EPOLLIN | EPOLLRDHUP) : 0U) | (gw_client_flushed(client) ? 0U : (uint32_t)EPOLLOUT);
    if (wanted == client->interest) {
        return;
    }
    struct epoll_event interest = {.events = wanted,
                                   .data = {.u64 = GW_TAG_CLIENT + (uint64_t)(client - self->client)}};
    client->interest = wanted;
    (void)epoll_ctl(self->epoll_fd, EPOLL_CTL_MOD, client->fd, &interest);
}

static bool flush(gw_clients_t *self, gw_client_t *client) {
    const bool waiting = !gw_client_flushed(client);
    gw_client_flush(client);
    if (client->failed && !client->closing) {
        finish(self, client);
    }
    if (client->closing && (gw_client_flushed(client) || self->now_us >= client->close_us)) {
        release(self, client);
    } else {
        update_interest(self, client);
    }
    return waiting;
}

void gw_service_flush(gw_clients_t *self, iw_client_t holder) {
    self->lines_wait = !go_round(self, holder, flush, self->next_flushed);
}

bool gw_service_is_busy(const gw_clients_t *self) {
    for (uint32_t i = gw_clients_from(self, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(self, i + 1U)) {
        if (has_turn(self, &self->client[i])) {
            return true;
        }
    }
    return self->some_wait || self->lines_wait;
}

iw_time_us_t gw_service_next_us(const gw_clients_t *self) {
    iw_time_us_t next_us = IW_NEVER;
    for (unsigned right = 0; right < GW_RIGHTS; right++) {
        const iw_time_us_t from_us = self->listener[right].from_us;
        next_us = (from_us != 0U && from_us < next_us) ? from_us : next_us;
    }
    for (uint32_t i = gw_clients_from(self, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(self, i + 1U)) {
        const gw_client_t *client = &self->client[i];
        if (client->closing && client->close_us < next_us) {
            next_us = client->close_us;
        }
        if (client->right == GW_WATCH && client->line_us < next_us && has_line(client)) {
            next_us = client->line_us;
        }
    }
    return next_us;
}

void gw_service_close_all(gw_clients_t *self) {
    for (uint32_t i = gw_clients_from(self, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(self, i + 1U)) {
        release(self, &self->client[i]);
    }
}
