// SPDX-License-Identifier: MIT
#include "slots.h"

#include "log.h"

#include "iwheel_linux/clock.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/// A connection that was just accepted.
typedef struct {
    int fd;
    struct ucred peer;
} newcomer_t;

/// Returns the socket at which a client beyond the maximum arrived.
static sock_right_t right_of(const sock_clients_t *self, const sock_client_t *client) {
    const uint32_t place = (uint32_t)(client - self->client) - sock_parts[SOCK_STOP].first;
    return (place < SOCK_STOP_SLOTS) ? SOCK_DRIVE : SOCK_WATCH;
}

/// Adds the connection. Returns false if it cannot be watched; then it is closed.
static bool admit(sock_clients_t *self, sock_client_t *client, const newcomer_t *newcomer, sock_right_t right) {
    const size_t slot = (size_t)(client - self->client);
    struct epoll_event interest = {.events = EPOLLIN | EPOLLRDHUP, .data = {.u64 = SOCK_TAG_CLIENT + slot}};
    if (epoll_ctl(self->epoll_fd, EPOLL_CTL_ADD, newcomer->fd, &interest) != 0) {
        (void)close(newcomer->fd);
        return false;
    }
    memset(client, 0, offsetof(sock_client_t, in));
    client->id = ++self->last_id;
    client->fd = newcomer->fd;
    client->pid = (int)newcomer->peer.pid;
    client->uid = newcomer->peer.uid;
    client->right = right;
    client->interest = interest.events;
    client->drained = true;
    client->caught_up_us = self->now_us;
    self->count[right]++;
    self->open[right] |= UINT64_C(1) << (slot - sock_parts[right].first);
    sock_log(self->log, SOCK_LOG_DEBUG, "client %u (pid %d) connected", (unsigned)client->id, client->pid);
    self->handler.welcome(self->handler.context, client);
    return true;
}

void sock_service_refuse_crowd(const sock_clients_t *self, const sock_client_t *client, iwn_refusal_t *out_refusal) {
    const sock_right_t right = right_of(self, client);
    out_refusal->error = IWN_TOO_MANY_CLIENTS;
    (void)snprintf(out_refusal->message, sizeof out_refusal->message,
                   "%u %s are connected and there is no place for more, except to stop; close one, or raise %s and the "
                   "limit of open files",
                   (unsigned)self->count[right], (right == SOCK_DRIVE) ? "clients" : "watchers",
                   (right == SOCK_DRIVE) ? "max_clients" : "max_watchers");
}

/// Closes a connection whose time has expired without a stop.
static void turn_away(sock_clients_t *self, sock_client_t *client) {
    const iwn_id_t no_id = {.kind = IWN_ID_NONE};
    sock_listener_t *listener = &self->listener[right_of(self, client)];
    iwn_refusal_t refusal;
    sock_service_refuse_crowd(self, client, &refusal);
    sock_clients_refuse(self, client, &no_id, &refusal);
    sock_service_finish(self, client);
    if (!listener->full_reported) {
        sock_log(self->log, SOCK_LOG_WARNING, "refused a client: %s", refusal.message);
    }
    listener->full_reported =
        listener->config.right == SOCK_WATCH; // A flood of these must not displace other messages.
}

static sock_client_t *free_slot(sock_clients_t *self, sock_right_t right) {
    for (uint32_t i = 0; i < sock_parts[right].slots && self->count[right] < self->most[right]; i++) {
        sock_client_t *client = &self->client[sock_parts[right].first + i];
        if (client->id == IW_CLIENT_NONE) {
            return client;
        }
    }
    return NULL;
}

/// Occupancy of a socket's places beyond the maximum, for one user.
typedef struct {
    sock_client_t *free_one;
    sock_client_t *oldest; ///< Oldest one that has sent nothing.
    sock_client_t *own;    ///< Oldest one of this user that has sent nothing.
    unsigned held;         ///< Number of places of this user.
} places_t;

static sock_client_t *older(sock_client_t *known, sock_client_t *other) {
    return (known == NULL || other->close_us < known->close_us) ? other : known;
}

static void find_oldest(places_t *seen, sock_client_t *place, uid_t uid) {
    const bool own = place->uid == uid;
    seen->held += own ? 1U : 0U;
    if (!place->executed && !sock_client_is_closing(place)) {
        seen->oldest = older(seen->oldest, place);
        if (own) {
            seen->own = older(seen->own, place);
        }
    }
}

static places_t survey(sock_client_t *first, uid_t uid) {
    places_t seen = {.held = 0};
    for (sock_client_t *place = first; place < &first[SOCK_STOP_PLACES]; place++) {
        if (place->id == IW_CLIENT_NONE) {
            seen.free_one = place;
        } else {
            find_oldest(&seen, place, uid);
        }
    }
    return seen;
}

/// Returns a place for this user: a free one, or the one that has sent nothing for longest, if that is long enough. A
/// user who has a full share replaces one of its own. Returns NULL if there is none.
static sock_client_t *stop_place(sock_clients_t *self, sock_client_t *first, uid_t uid) {
    const places_t seen = survey(first, uid);
    const bool has_share = uid != 0U && seen.held >= SOCK_STOP_PLACES / 2U;
    if (seen.free_one != NULL && !has_share) {
        return seen.free_one;
    }
    sock_client_t *place = has_share ? seen.own : seen.oldest;
    if (place == NULL || self->now_us + SOCK_STOP_US < place->close_us + SOCK_STOP_LEAST_US) {
        return NULL;
    }
    turn_away(self, place);
    sock_client_flush(place);
    sock_service_release(self, place);
    return place;
}

/// All places of the socket are in use. Reads the first line of the connection immediately, and waits for it if a place
/// to wait in is free.
static void receive_stop(sock_clients_t *self, const newcomer_t *newcomer, sock_right_t right, bool may_wait) {
    sock_client_t *first = &self->client[sock_parts[SOCK_STOP].first + right * SOCK_STOP_SLOTS];
    sock_client_t *place = may_wait ? stop_place(self, first, newcomer->peer.uid) : NULL;
    sock_client_t *client = (place != NULL) ? place : &first[SOCK_STOP_PLACES];
    if (!admit(self, client, newcomer, SOCK_STOP)) {
        return;
    }
    client->close_us = self->now_us + SOCK_STOP_US;
    client->readable = true;
    sock_service_serve(self, client);
    if (place == NULL && !sock_client_is_closing(client) && !client->executed) {
        turn_away(self, client);
    }
    (void)sock_service_flush_one(self, client);
    if (place == NULL && client->id != IW_CLIENT_NONE) {
        sock_service_release(self, client);
    }
}

/// Sets whether a listening socket wakes the loop.
static void listen_to_newcomers(sock_clients_t *self, const sock_listener_t *listener, bool wanted) {
    const uint64_t tag = (listener->config.right == SOCK_DRIVE) ? SOCK_TAG_LISTENER : SOCK_TAG_WATCH_LISTENER;
    struct epoll_event interest = {.events = wanted ? EPOLLIN : 0U, .data = {.u64 = tag}};
    (void)epoll_ctl(self->epoll_fd, EPOLL_CTL_MOD, listener->fd, &interest);
}

static void pause_listening(sock_clients_t *self, sock_listener_t *listener, iw_time_us_t pause_us) {
    listener->from_us = self->now_us + pause_us;
    listen_to_newcomers(self, listener, false);
}

/// Accepts one connection. Returns false if there is none, or none can be accepted now.
static bool accept_one(sock_clients_t *self, sock_listener_t *listener) {
    newcomer_t newcomer = {.peer = {0}};
    socklen_t length = sizeof newcomer.peer;
    const sock_accept_t result = sock_listener_accept(listener, &newcomer.fd);
    if (result == SOCK_ACCEPT_NONE) {
        return false;
    }
    if (result == SOCK_ACCEPT_PAUSE) {
        sock_log(self->log, SOCK_LOG_WARNING, "cannot accept clients: no free descriptor; trying again in %u ms",
                 SOCK_LISTENER_PAUSE_US / IW_US_PER_MS);
        pause_listening(self, listener, SOCK_LISTENER_PAUSE_US);
        return false;
    }
    (void)getsockopt(newcomer.fd, SOL_SOCKET, SO_PEERCRED, &newcomer.peer, &length);
    sock_client_t *client = (result == SOCK_ACCEPT_ONE) ? free_slot(self, listener->config.right) : NULL;
    if (client != NULL) {
        listener->full_reported = false;
        (void)admit(self, client, &newcomer, listener->config.right);
    } else {
        receive_stop(self, &newcomer, listener->config.right, result == SOCK_ACCEPT_ONE);
    }
    return true;
}

/// Accepts connections. Returns true if there was one.
static bool accept_some(sock_clients_t *self, sock_listener_t *listener) {
    const iw_time_us_t until_us = iwl_clock_now_us() + SOCK_ROUND_US;
    bool some = false;
    for (unsigned i = 0; i < SOCK_ACCEPTS_PER_CYCLE && (i == 0U || iwl_clock_now_us() < until_us); i++) {
        if (!accept_one(self, listener)) {
            return some;
        }
        some = true;
    }
    return some;
}

void sock_service_accept(sock_clients_t *self) {
    sock_listener_t *watch = &self->listener[SOCK_WATCH];
    (void)accept_some(self, &self->listener[SOCK_DRIVE]);
    if (watch->fd >= 0 && watch->from_us == 0U && accept_some(self, watch) && watch->from_us == 0U) {
        pause_listening(self, watch, SOCK_WATCHER_ACCEPT_US);
    }
}

void sock_service_poll_arrivals(sock_clients_t *self) {
    uint32_t i =
        (self->count[SOCK_STOP] > 0U) ? sock_clients_from(self, sock_parts[SOCK_STOP].first) : SOCK_CLIENTS_MAX;
    for (; i < SOCK_CLIENTS_MAX; i = sock_clients_from(self, i + 1U)) {
        sock_client_t *client = &self->client[i];
        if (sock_client_is_closing(client) || self->now_us < client->close_us) {
            continue;
        }
        if (client->executed) {
            sock_service_finish(self, client);
        } else {
            turn_away(self, client);
        }
    }
    for (unsigned right = 0; right < SOCK_RIGHTS; right++) {
        sock_listener_t *listener = &self->listener[right];
        if (listener->from_us != 0U && self->now_us >= listener->from_us) {
            listener->from_us = 0;
            listen_to_newcomers(self, listener, true);
        }
    }
}
