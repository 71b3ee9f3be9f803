// SPDX-License-Identifier: MIT
/// Serving the clients: accept, read, carry out, flush, close. Bounded work for each of them in each cycle.
#ifndef GATEWAY_SERVICE_H
#define GATEWAY_SERVICE_H

#include "clients.h"

/// What a descriptor in the epoll set stands for; a client's tag is GW_TAG_CLIENT plus its slot.
enum {
    GW_TAG_TIMER = 0,
    GW_TAG_SIGNAL,
    GW_TAG_LISTENER,
    GW_TAG_WATCH_LISTENER,
    GW_TAG_BUS,
    GW_TAG_ESTOP,
    GW_TAG_BOX,
    GW_TAG_CLIENT
};

/// Lines of one client that are carried out in one cycle.
#define GW_LINES_PER_CYCLE 4U

/// Connections accepted in one cycle.
#define GW_ACCEPTS_PER_CYCLE 4U

/// Reading and carrying out, and then sending, take no longer than this each (and one client's turn) in one cycle: the
/// wheels and the e-stop wait for no number of clients.
#define GW_ROUND_US 500U

/// Watchers come behind all who may drive, in what is left of that time (one of them always has a turn). After one
/// turn of several, one line of each is carried out in so long, and one newcomer is let in: a flood of them, even of `estop`, is as slow as that.
#define GW_WATCHER_LINE_US   10000U
#define GW_WATCHER_ACCEPT_US 2000U

/// Takes newcomers, or tells them that there is no room.
void gw_service_accept(gw_clients_t *self);

/// Reads from the clients that have something to say and carries out their next lines: the holder of the lease first,
/// then the others who may drive, then the watchers, as many as the time allows, the rest in the next cycle.
void gw_service_clients(gw_clients_t *self, iw_client_t holder);

/// Sends what is queued, closes what is finished, and tells epoll what to watch next. In the same order, within the
/// same time.
void gw_service_flush(gw_clients_t *self, iw_client_t holder);

/// True if somebody waits for us: the next wait must not sleep.
bool gw_service_is_busy(const gw_clients_t *self);

/// When something is due although nobody says anything: a connection to be closed, accepting to be taken up again.
iw_time_us_t gw_service_next_us(const gw_clients_t *self);

/// Closes every connection, at the end.
void gw_service_close_all(gw_clients_t *self);

#endif
