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
    client->interest = interest.events;
    client->rate_hz = IWN_RATE_DEFAULT_HZ;
    client->drained = true;
    client->caught_up_us = daemon->now_us;
    daemon->clients++;
    gw_log(&daemon->log, GW_LOG_DEBUG, "client %u (pid %d) connected", (unsigned)client->id, client->pid);
    gw_observe_hello(daemon, client);
}

static void turn_away(gw_daemon_t *daemon, int fd) {
    const iwn_id_t nobody = {.kind = IWN_ID_NONE};
    iwn_refusal_t refusal = {.error = IWN_TOO_MANY_CLIENTS};
    (void)snprintf(refusal.message, sizeof refusal.message,
                   "%u clients are connected and there is no room for more; close one, or raise max_clients and the "
                   "limit of open files",
                   (unsigned)daemon->clients);
    const size_t length = gw_dispatch_write_refusal(daemon, &nobody, &refusal);
    (void)send(fd, daemon->line, length, MSG_DONTWAIT | MSG_NOSIGNAL);
    (void)close(fd);
    gw_log(&daemon->log, GW_LOG_WARNING, "a client was turned away: %s", refusal.message);
}

static gw_client_t *free_slot(gw_daemon_t *daemon) {
    for (uint32_t i = 0; i < GW_CLIENTS_MAX && daemon->clients < daemon->config.northbound.max_clients; i++) {
        if (daemon->client[i].id == IW_CLIENT_NONE) {
            return &daemon->client[i];
        }
    }
    return NULL;
}

/// Whether the listening socket wakes the loop.
static void listen_to_newcomers(gw_daemon_t *daemon, bool wanted) {
    struct epoll_event interest = {.events = wanted ? EPOLLIN : 0U, .data = {.u64 = GW_TAG_LISTENER}};
    (void)epoll_ctl(daemon->epoll_fd, EPOLL_CTL_MOD, daemon->listener.fd, &interest);
}

void gw_service_accept(gw_daemon_t *daemon) {
    for (unsigned i = 0; i < GW_ACCEPTS_PER_CYCLE; i++) {
        int fd;
        const gw_accept_t result = gw_listener_accept(&daemon->listener, &fd);
        gw_client_t *client = (result == GW_ACCEPT_ONE) ? free_slot(daemon) : NULL;
        if (result == GW_ACCEPT_NONE) {
            return;
        }
        if (result == GW_ACCEPT_PAUSE) {
            gw_log(&daemon->log, GW_LOG_WARNING, "cannot accept clients for want of descriptors; trying again in %u ms",
                   GW_LISTENER_PAUSE_US / IW_US_PER_MS);
            daemon->listen_from_us = daemon->now_us + GW_LISTENER_PAUSE_US;
            listen_to_newcomers(daemon, false);
            return;
        }
        if (client != NULL) {
            welcome(daemon, client, fd);
        } else {
            turn_away(daemon, fd);
            gw_listener_restore(&daemon->listener);
        }
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

static void carry_out_lines(gw_daemon_t *daemon, gw_client_t *client) {
    for (unsigned i = 0; i < GW_LINES_PER_CYCLE && !client->arming && !client->closing && !client->failed; i++) {
        size_t length;
        const char *line = gw_client_line(client, &length);
        if (line == NULL) {
            break;
        }
        gw_dispatch_line(daemon, client, line, length);
        gw_client_drop_line(client, length);
    }
}

static bool has_line(const gw_client_t *client) {
    size_t length;
    return !client->closing && !client->arming && gw_client_line(client, &length) != NULL;
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

/// The holder of the lease first, then the others, from where the last round ended, until the time is up. At least one
/// of them is served. True if all were.
static bool go_round(gw_daemon_t *daemon, service_t service, uint32_t *next) {
    iw_time_us_t end_us = 0; // Of the time for all but the first.
    gw_client_t *holder = gw_daemon_client(daemon, gw_daemon_look(daemon).holder);
    const uint32_t first = *next;
    bool worked = false;
    if (holder != NULL) {
        (void)service(daemon, holder);
    }
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        gw_client_t *client = &daemon->client[(first + i) % GW_CLIENTS_MAX];
        const iw_time_us_t now_us = worked ? iw_clock_now_us() : 0U;
        end_us = (end_us == 0U && worked) ? now_us + GW_ROUND_US : end_us;
        if (worked && now_us >= end_us) {
            *next = (first + i) % GW_CLIENTS_MAX;
            return false;
        }
        worked = (client->id != IW_CLIENT_NONE && client != holder && service(daemon, client)) || worked;
    }
    return true;
}

static bool serve_if_wanted(gw_daemon_t *daemon, gw_client_t *client) {
    const bool wanted = client->readable || client->hung_up || has_line(client);
    if (wanted) {
        serve(daemon, client);
    }
    return wanted;
}

void gw_service_clients(gw_daemon_t *daemon) {
    daemon->clients_waiting = !go_round(daemon, serve_if_wanted, &daemon->next_served);
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        gw_client_t *client = &daemon->client[i];
        if (client->id != IW_CLIENT_NONE && !client->readable) {
            gw_client_note_caught_up(client, daemon->woken_us);
        }
    }
    if (daemon->listen_from_us != 0U && daemon->now_us >= daemon->listen_from_us) {
        daemon->listen_from_us = 0;
        listen_to_newcomers(daemon, true);
    }
}

/// Reading is wanted unless there is no room or no use; writing only while something waits.
static void update_interest(gw_daemon_t *daemon, gw_client_t *client) {
    const bool reading = !client->closing && !client->ended && client->in_length < sizeof client->in;
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
    daemon->lines_waiting = !go_round(daemon, flush, &daemon->next_flushed);
}

bool gw_service_is_busy(const gw_daemon_t *daemon) {
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        if (daemon->client[i].id != IW_CLIENT_NONE && has_line(&daemon->client[i])) {
            return true;
        }
    }
    return daemon->requested || daemon->clients_waiting || daemon->lines_waiting;
}

iw_time_us_t gw_service_next_us(const gw_daemon_t *daemon) {
    iw_time_us_t next_us = (daemon->listen_from_us != 0U) ? daemon->listen_from_us : IW_NEVER;
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        const gw_client_t *client = &daemon->client[i];
        if (client->id != IW_CLIENT_NONE && client->closing && client->close_us < next_us) {
            next_us = client->close_us;
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
