// SPDX-License-Identifier: MIT
#include "service.h"

#include "dispatch.h"
#include "status/observe.h"

#include "iwheel_linux/clock.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

static void welcome(gw_daemon_t *daemon, gw_client_t *client, int fd) {
    struct ucred peer = {0};
    socklen_t length = sizeof peer;
    (void)getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &length);
    const size_t slot = (size_t)(client - daemon->client);
    struct epoll_event interest = {.events = EPOLLIN | EPOLLRDHUP, .data = {.u64 = GW_TAG_CLIENT + slot}};
    if (epoll_ctl(daemon->epoll_fd, EPOLL_CTL_ADD, fd, &interest) != 0) {
        (void)close(fd);
        return;
    }
    memset(client, 0, offsetof(gw_client_t, in));
    client->id = ++daemon->last_client;
    client->fd = fd;
    client->pid = (int)peer.pid;
    client->uid = peer.uid;
    client->right = (slot < GW_DRIVERS_MAX) ? GW_DRIVE : GW_WATCH;
    client->interest = interest.events;
    client->rate_hz = IWN_RATE_DEFAULT_HZ;
    client->drained = true;
    client->caught_up_us = daemon->now_us;
    daemon->clients++;
    daemon->watchers += (client->right == GW_WATCH) ? 1U : 0U;
    gw_log(&daemon->log, GW_LOG_DEBUG, "client %u (pid %d) connected", (unsigned)client->id, client->pid);
    gw_observe_hello(daemon, client);
}

/// Connected by a right.
static uint32_t count_of(const gw_daemon_t *daemon, gw_right_t right) {
    return (right == GW_WATCH) ? daemon->watchers : daemon->clients - daemon->watchers;
}

static void turn_away(gw_daemon_t *daemon, gw_listener_t *listener, int fd) {
    const iwn_id_t nobody = {.kind = IWN_ID_NONE};
    iwn_refusal_t refusal = {.error = IWN_TOO_MANY_CLIENTS};
    (void)snprintf(refusal.message, sizeof refusal.message,
                   "%u %s are connected and there is no room for more; close one, or raise %s and the limit of open "
                   "files",
                   (unsigned)count_of(daemon, listener->right), (listener->right == GW_DRIVE) ? "clients" : "watchers",
                   (listener->right == GW_DRIVE) ? "max_clients" : "max_watchers");
    const size_t length = gw_dispatch_write_refusal(daemon, &nobody, &refusal);
    (void)send(fd, daemon->line, length, MSG_DONTWAIT | MSG_NOSIGNAL);
    (void)close(fd);
    if (!listener->full_told) {
        gw_log(&daemon->log, GW_LOG_WARNING, "a client was turned away: %s", refusal.message);
    }
    listener->full_told = listener->right == GW_WATCH; // A flood of these must not crowd out other messages.
}

static gw_client_t *free_slot(gw_daemon_t *daemon, gw_right_t right) {
    const uint32_t first = (right == GW_DRIVE) ? 0U : GW_DRIVERS_MAX;
    const uint32_t end = (right == GW_DRIVE) ? GW_DRIVERS_MAX : GW_CLIENTS_MAX;
    const uint32_t most =
        (right == GW_DRIVE) ? daemon->config.northbound.max_clients : daemon->config.northbound.max_watchers;
    for (uint32_t i = first; i < end && count_of(daemon, right) < most; i++) {
        if (daemon->client[i].id == IW_CLIENT_NONE) {
            return &daemon->client[i];
        }
    }
    return NULL;
}

/// Whether a listening socket wakes the loop.
static void listen_to_newcomers(gw_daemon_t *daemon, const gw_listener_t *listener, bool wanted) {
    const uint64_t tag = (listener->right == GW_DRIVE) ? GW_TAG_LISTENER : GW_TAG_WATCH_LISTENER;
    struct epoll_event interest = {.events = wanted ? EPOLLIN : 0U, .data = {.u64 = tag}};
    (void)epoll_ctl(daemon->epoll_fd, EPOLL_CTL_MOD, listener->fd, &interest);
}

static void pause_listening(gw_daemon_t *daemon, gw_listener_t *listener, iw_time_us_t pause_us) {
    listener->from_us = daemon->now_us + pause_us;
    listen_to_newcomers(daemon, listener, false);
}

/// Takes one newcomer. False: there is none, or none for now.
static bool accept_one(gw_daemon_t *daemon, gw_listener_t *listener) {
    int fd;
    const gw_accept_t result = gw_listener_accept(listener, &fd);
    gw_client_t *client = (result == GW_ACCEPT_ONE) ? free_slot(daemon, listener->right) : NULL;
    if (result == GW_ACCEPT_NONE) {
        return false;
    }
    if (result == GW_ACCEPT_PAUSE) {
        gw_log(&daemon->log, GW_LOG_WARNING, "cannot accept clients for want of descriptors; trying again in %u ms",
               GW_LISTENER_PAUSE_US / IW_US_PER_MS);
        pause_listening(daemon, listener, GW_LISTENER_PAUSE_US);
        return false;
    }
    if (client != NULL) {
        listener->full_told = false;
        welcome(daemon, client, fd);
    } else {
        turn_away(daemon, listener, fd);
        gw_listener_restore(listener);
    }
    return true;
}

void gw_service_accept(gw_daemon_t *daemon) {
    gw_listener_t *watch = &daemon->listener[GW_WATCH];
    for (unsigned i = 0; i < GW_ACCEPTS_PER_CYCLE && accept_one(daemon, &daemon->listener[GW_DRIVE]); i++) {
    }
    if (watch->fd >= 0 && watch->from_us == 0U && accept_one(daemon, watch)) {
        pause_listening(daemon, watch, GW_WATCHER_ACCEPT_US);
    }
}

/// The client is no longer there for the core: its lease ends now.
static void end_lease(gw_daemon_t *daemon, gw_client_t *client) {
    daemon->now_us = iw_clock_now_us();
    iw_gateway_disconnect(&daemon->gateway, daemon->now_us, client->id);
    gw_tape_put(&daemon->tape,
                &(blackbox_entry_t){.at_us = daemon->now_us, .kind = BLACKBOX_GONE, .number = client->id});
    client->arming = false;
    daemon->requested = true;
    gw_observe(daemon);
}

static void release(gw_daemon_t *daemon, gw_client_t *client) {
    gw_log(&daemon->log, GW_LOG_DEBUG, "client %u (pid %d) closed", (unsigned)client->id, client->pid);
    (void)close(client->fd);
    client->id = IW_CLIENT_NONE;
    client->topics = 0;
    daemon->clients--;
    daemon->watchers -= (client->right == GW_WATCH) ? 1U : 0U;
}

static void refuse_long_line(gw_daemon_t *daemon, gw_client_t *client) {
    const iwn_id_t nobody = {.kind = IWN_ID_NONE};
    iwn_refusal_t refusal = {.error = IWN_LINE_TOO_LONG};
    (void)snprintf(refusal.message, sizeof refusal.message,
                   "a request has at most %u bytes and ends with a newline; the connection is closed", IWN_LINE_MAX);
    gw_client_reply(client, daemon->line, gw_dispatch_write_refusal(daemon, &nobody, &refusal));
    end_lease(daemon, client);
    gw_client_finish(client, daemon->now_us);
}

static bool has_line(const gw_client_t *client) {
    size_t length;
    return !client->closing && !client->arming && gw_client_line(client, &length) != NULL;
}

/// A line of it may be carried out now. One that has hung up is done with at once.
static bool has_turn(const gw_daemon_t *daemon, const gw_client_t *client) {
    const bool in_time = client->right == GW_DRIVE || client->hung_up || daemon->now_us >= client->line_us;
    return in_time && has_line(client);
}

/// After a pause as many as fit into one turn are carried out together.
static void pace(gw_client_t *client, iw_time_us_t now_us) {
    const iw_time_us_t saved_us = (GW_LINES_PER_CYCLE - 1U) * GW_WATCHER_LINE_US;
    const bool rested = now_us >= client->line_us + saved_us;
    client->line_us = (rested ? now_us - saved_us : client->line_us) + GW_WATCHER_LINE_US;
}

static void carry_out_lines(gw_daemon_t *daemon, gw_client_t *client) {
    for (unsigned i = 0; i < GW_LINES_PER_CYCLE && !client->failed && has_turn(daemon, client); i++) {
        size_t length;
        const char *line = gw_client_line(client, &length);
        gw_dispatch_line(daemon, client, line, length);
        gw_client_drop_line(client, length);
        pace(client, daemon->now_us);
    }
}

/// Nothing of it is left to be done, but for a recording that it waits for and can take.
static bool has_ended(const gw_client_t *client) {
    const bool waits = client->reading && !client->hung_up;
    return client->ended && (client->arming || (!has_line(client) && !waits));
}

static void serve(gw_daemon_t *daemon, gw_client_t *client) {
    if (client->leaving) {
        end_lease(daemon, client); // At once, whatever it has sent before.
    }
    if (client->readable || client->hung_up) {
        gw_client_read(client);
    }
    carry_out_lines(daemon, client);
    if (!client->closing && !client->arming && gw_client_line_too_long(client)) {
        refuse_long_line(daemon, client);
    }
    const bool gone = client->failed || has_ended(client);
    if (gone && !client->closing) {
        end_lease(daemon, client);
        gw_client_finish(client, daemon->now_us);
    }
    if (client->hung_up && client->closing) {
        client->failed = true; // Nobody reads any more.
    }
    client->readable = false;
}

/// Somebody served in a round, and whether there was anything to do.
typedef bool (*service_t)(gw_daemon_t *daemon, gw_client_t *client);

/// One round of all, and how far it came.
typedef struct {
    service_t service;
    const gw_client_t *holder;
    iw_time_us_t end_us; ///< Of the time for all but the first; 0: nobody had anything to do yet.
} round_t;

/// Those with one right, from where their last round ended, until the time is up. At least one of them is served. True if all
/// were.
static bool go_among(gw_daemon_t *daemon, round_t *round, gw_right_t right, uint32_t *next) {
    const uint32_t base = (right == GW_DRIVE) ? 0U : GW_DRIVERS_MAX;
    const uint32_t slots = (right == GW_DRIVE) ? GW_DRIVERS_MAX : GW_WATCHERS_MAX;
    const uint32_t first = *next;
    bool worked = false;
    for (uint32_t i = 0; i < slots; i++) {
        const uint32_t slot = (first + i) % slots;
        gw_client_t *client = &daemon->client[base + slot];
        const iw_time_us_t now_us = worked ? iw_clock_now_us() : 0U;
        round->end_us = (round->end_us == 0U && worked) ? now_us + GW_ROUND_US : round->end_us;
        if (worked && now_us >= round->end_us) {
            *next = slot;
            return false;
        }
        worked = (client->id != IW_CLIENT_NONE && client != round->holder && round->service(daemon, client)) || worked;
    }
    return true;
}

/// The holder of the lease first, then who else may drive, then the watchers. True if all were served.
static bool go_round(gw_daemon_t *daemon, service_t service, uint32_t next[GW_RIGHTS]) {
    gw_client_t *holder = gw_daemon_client(daemon, gw_daemon_look(daemon).holder);
    round_t round = {.service = service, .holder = holder};
    if (holder != NULL) {
        (void)service(daemon, holder);
    }
    const bool all = go_among(daemon, &round, GW_DRIVE, &next[GW_DRIVE]);
    return go_among(daemon, &round, GW_WATCH, &next[GW_WATCH]) && all;
}

static bool serve_if_wanted(gw_daemon_t *daemon, gw_client_t *client) {
    const bool wanted = client->readable || client->hung_up || has_turn(daemon, client);
    if (wanted) {
        serve(daemon, client);
    }
    return wanted;
}

void gw_service_clients(gw_daemon_t *daemon) {
    daemon->clients_waiting = !go_round(daemon, serve_if_wanted, daemon->next_served);
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        gw_client_t *client = &daemon->client[i];
        if (client->id != IW_CLIENT_NONE && !client->readable) {
            gw_client_note_caught_up(client, daemon->woken_us);
        }
    }
    for (unsigned right = 0; right < GW_RIGHTS; right++) {
        gw_listener_t *listener = &daemon->listener[right];
        if (listener->from_us != 0U && daemon->now_us >= listener->from_us) {
            listener->from_us = 0;
            listen_to_newcomers(daemon, listener, true);
        }
    }
}

/// Reading is wanted unless there is no room or no use (a watcher whose next line has to wait wakes nobody with more of them);
/// writing only while something waits.
static void update_interest(gw_daemon_t *daemon, gw_client_t *client) {
    const bool reading = !client->closing && !client->ended && client->in_length < sizeof client->in &&
                         (client->right == GW_DRIVE || !has_line(client));
    const uint32_t wanted =
        (reading ? (uint32_t)(EPOLLIN | EPOLLRDHUP) : 0U) | (gw_client_flushed(client) ? 0U : (uint32_t)EPOLLOUT);
    if (wanted == client->interest) {
        return;
    }
    struct epoll_event interest = {.events = wanted,
                                   .data = {.u64 = GW_TAG_CLIENT + (uint64_t)(client - daemon->client)}};
    client->interest = wanted;
    (void)epoll_ctl(daemon->epoll_fd, EPOLL_CTL_MOD, client->fd, &interest);
}

static bool flush(gw_daemon_t *daemon, gw_client_t *client) {
    const bool waiting = !gw_client_flushed(client);
    gw_client_flush(client);
    if (client->failed && !client->closing) {
        end_lease(daemon, client);
        gw_client_finish(client, daemon->now_us);
    }
    if (client->closing && (gw_client_flushed(client) || daemon->now_us >= client->close_us)) {
        release(daemon, client);
    } else {
        update_interest(daemon, client);
    }
    return waiting;
}

void gw_service_flush(gw_daemon_t *daemon) {
    daemon->lines_waiting = !go_round(daemon, flush, daemon->next_flushed);
}

bool gw_service_is_busy(const gw_daemon_t *daemon) {
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        if (daemon->client[i].id != IW_CLIENT_NONE && has_turn(daemon, &daemon->client[i])) {
            return true;
        }
    }
    return daemon->requested || daemon->clients_waiting || daemon->lines_waiting;
}

iw_time_us_t gw_service_next_us(const gw_daemon_t *daemon) {
    iw_time_us_t next_us = IW_NEVER;
    for (unsigned right = 0; right < GW_RIGHTS; right++) {
        const iw_time_us_t from_us = daemon->listener[right].from_us;
        next_us = (from_us != 0U && from_us < next_us) ? from_us : next_us;
    }
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        const gw_client_t *client = &daemon->client[i];
        if (client->id != IW_CLIENT_NONE && client->closing && client->close_us < next_us) {
            next_us = client->close_us;
        }
        if (client->id != IW_CLIENT_NONE && client->right == GW_WATCH && client->line_us < next_us &&
            has_line(client)) {
            next_us = client->line_us;
        }
    }
    return next_us;
}

void gw_service_close_all(gw_daemon_t *daemon) {
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        if (daemon->client[i].id != IW_CLIENT_NONE) {
            release(daemon, &daemon->client[i]);
        }
    }
}
