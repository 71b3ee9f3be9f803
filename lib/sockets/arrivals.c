// SPDX-License-Identifier: MIT
#include "slots.h"

#include "log.h"

#include "iwheel_linux/clock.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/// A connection that has just been accepted.
typedef struct {
    int fd;
    struct ucred peer;
} newcomer_t;

/// The socket by which a client beyond the maximum has come.
static gw_right_t door_of(const gw_clients_t *self, const gw_client_t *client) {
    const uint32_t place = (uint32_t)(client - self->client) - gw_parts[GW_STOP].first;
    return (place < GW_STOP_SLOTS) ? GW_DRIVE : GW_WATCH;
}

/// False: it cannot be watched, and is closed.
static bool admit(gw_clients_t *self, gw_client_t *client, const newcomer_t *newcomer, gw_right_t right) {
    const size_t slot = (size_t)(client - self->client);
    struct epoll_event interest = {.events = EPOLLIN | EPOLLRDHUP, .data = {.u64 = GW_TAG_CLIENT + slot}};
    if (epoll_ctl(self->epoll_fd, EPOLL_CTL_ADD, newcomer->fd, &interest) != 0) {
        (void)close(newcomer->fd);
        return false;
    }
    memset(client, 0, offsetof(gw_client_t, in));
    client->id = ++self->last_id;
    client->fd = newcomer->fd;
    client->pid = (int)newcomer->peer.pid;
    client->uid = newcomer->peer.uid;
    client->right = right;
    client->interest = interest.events;
    client->drained = true;
    client->caught_up_us = self->now_us;
    self->count[right]++;
    self->open[right] |= UINT64_C(1) << (slot - gw_parts[right].first);
    gw_log(self->log, GW_LOG_DEBUG, "client %u (pid %d) connected", (unsigned)client->id, client->pid);
    self->servant.welcome(self->servant.context, client);
    return true;
}

void gw_service_refuse_crowd(const gw_clients_t *self, const gw_client_t *client, iwn_refusal_t *out_refusal) {
    const gw_right_t door = door_of(self, client);
    out_refusal->error = IWN_TOO_MANY_CLIENTS;
    (void)snprintf(out_refusal->message, sizeof out_refusal->message,
                   "%u %s are connected and there is no room for more, except to stop; close one, or raise %s and the "
                   "limit of open files",
                   (unsigned)self->count[door], (door == GW_DRIVE) ? "clients" : "watchers",
                   (door == GW_DRIVE) ? "max_clients" : "max_watchers");
}

/// Its time is over, and it has said no stop.
static void turn_away(gw_clients_t *self, gw_client_t *client) {
    const iwn_id_t nobody = {.kind = IWN_ID_NONE};
    gw_listener_t *listener = &self->listener[door_of(self, client)];
    iwn_refusal_t refusal;
    gw_service_refuse_crowd(self, client, &refusal);
    gw_clients_refuse(self, client, &nobody, &refusal);
    gw_service_finish(self, client);
    if (!listener->full_told) {
        gw_log(self->log, GW_LOG_WARNING, "a client was turned away: %s", refusal.message);
    }
    listener->full_told = listener->wish.right == GW_WATCH; // A flood of these must not crowd out other messages.
}

static gw_client_t *free_slot(gw_clients_t *self, gw_right_t right) {
    for (uint32_t i = 0; i < gw_parts[right].slots && self->count[right] < self->most[right]; i++) {
        gw_client_t *client = &self->client[gw_parts[right].first + i];
        if (client->id == IW_CLIENT_NONE) {
            return client;
        }
    }
    return NULL;
}

/// What there is among a socket's places beyond the maximum, for one user.
typedef struct {
    gw_client_t *free_one;
    gw_client_t *oldest; ///< Of those that have said nothing.
    gw_client_t *own;    ///< The same of this user's.
    unsigned held;       ///< By this user.
} places_t;

static gw_client_t *older(gw_client_t *known, gw_client_t *other) {
    return (known == NULL || other->close_us < known->close_us) ? other : known;
}

static void look_at_taken(places_t *seen, gw_client_t *place, uid_t uid) {
    const bool own = place->uid == uid;
    seen->held += own ? 1U : 0U;
    if (!place->said && !gw_client_is_closing(place)) {
        seen->oldest = older(seen->oldest, place);
        if (own) {
            seen->own = older(seen->own, place);
        }
    }
}

static places_t look_over(gw_client_t *first, uid_t uid) {
    places_t seen = {.held = 0};
    for (gw_client_t *place = first; place < &first[GW_STOP_PLACES]; place++) {
        if (place->id == IW_CLIENT_NONE) {
            seen.free_one = place;
        } else {
            look_at_taken(&seen, place, uid);
        }
    }
    return seen;
}

/// A place for this user: a free one, or the one that has been silent for longest, if that is long enough. Whoever has its share
/// makes room in it. NULL: there is none.
static gw_client_t *stop_place(gw_clients_t *self, gw_client_t *first, uid_t uid) {
    const places_t seen = look_over(first, uid);
    const bool has_share = uid != 0U && seen.held >= GW_STOP_PLACES / 2U;
    if (seen.free_one != NULL && !has_share) {
        return seen.free_one;
    }
    gw_client_t *room = has_share ? seen.own : seen.oldest;
    if (room == NULL || self->now_us + GW_STOP_US < room->close_us + GW_STOP_LEAST_US) {
        return NULL;
    }
    turn_away(self, room);
    gw_client_flush(room);
    gw_service_release(self, room);
    return room;
}

/// All places of its socket are taken: its first line is looked for at once, and awaited if there is a place to wait in.
static void hear_stop(gw_clients_t *self, const newcomer_t *newcomer, gw_right_t door, bool may_wait) {
    gw_client_t *first = &self->client[gw_parts[GW_STOP].first + door * GW_STOP_SLOTS];
    gw_client_t *place = may_wait ? stop_place(self, first, newcomer->peer.uid) : NULL;
    gw_client_t *client = (place != NULL) ? place : &first[GW_STOP_PLACES];
    if (!admit(self, client, newcomer, GW_STOP)) {
        return;
    }
    client->close_us = self->now_us + GW_STOP_US;
    client->readable = true;
    gw_service_serve(self, client);
    if (place == NULL && !gw_client_is_closing(client) && !client->said) {
        turn_away(self, client);
    }
    (void)gw_service_flush_one(self, client);
    if (place == NULL && client->id != IW_CLIENT_NONE) {
        gw_service_release(self, client);
    }
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
    newcomer_t newcomer = {.peer = {0}};
    socklen_t length = sizeof newcomer.peer;
    const gw_accept_t result = gw_listener_accept(listener, &newcomer.fd);
    if (result == GW_ACCEPT_NONE) {
        return false;
    }
    if (result == GW_ACCEPT_PAUSE) {
        gw_log(self->log, GW_LOG_WARNING, "cannot accept clients for want of descriptors; trying again in %u ms",
               GW_LISTENER_PAUSE_US / IW_US_PER_MS);
        pause_listening(self, listener, GW_LISTENER_PAUSE_US);
        return false;
    }
    (void)getsockopt(newcomer.fd, SOL_SOCKET, SO_PEERCRED, &newcomer.peer, &length);
    gw_client_t *client = (result == GW_ACCEPT_ONE) ? free_slot(self, listener->wish.right) : NULL;
    if (client != NULL) {
        listener->full_told = false;
        (void)admit(self, client, &newcomer, listener->wish.right);
    } else {
        hear_stop(self, &newcomer, listener->wish.right, result == GW_ACCEPT_ONE);
    }
    return true;
}

/// True if there was one.
static bool accept_some(gw_clients_t *self, gw_listener_t *listener) {
    const iw_time_us_t until_us = iw_clock_now_us() + GW_ROUND_US;
    bool some = false;
    for (unsigned i = 0; i < GW_ACCEPTS_PER_CYCLE && (i == 0U || iw_clock_now_us() < until_us); i++) {
        if (!accept_one(self, listener)) {
            return some;
        }
        some = true;
    }
    return some;
}

void gw_service_accept(gw_clients_t *self) {
    gw_listener_t *watch = &self->listener[GW_WATCH];
    (void)accept_some(self, &self->listener[GW_DRIVE]);
    if (watch->fd >= 0 && watch->from_us == 0U && accept_some(self, watch) && watch->from_us == 0U) {
        pause_listening(self, watch, GW_WATCHER_ACCEPT_US);
    }
}

void gw_service_tend_arrivals(gw_clients_t *self) {
    uint32_t i = (self->count[GW_STOP] > 0U) ? gw_clients_from(self, gw_parts[GW_STOP].first) : GW_CLIENTS_MAX;
    for (; i < GW_CLIENTS_MAX; i = gw_clients_from(self, i + 1U)) {
        gw_client_t *client = &self->client[i];
        if (gw_client_is_closing(client) || self->now_us < client->close_us) {
            continue;
        }
        if (client->said) {
            gw_service_finish(self, client);
        } else {
            turn_away(self, client);
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
