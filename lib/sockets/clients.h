// SPDX-License-Identifier: MIT
/// The table of all connections, who serves them, and the lines that they are sent: replies, refusals, events.
///
/// A line is written in `line`, one at a time.
#ifndef GATEWAY_CLIENTS_H
#define GATEWAY_CLIENTS_H

#include "client.h"

#include "iwheel_northbound/json_out.h"

struct gw_log;

/// Slots of those who may drive, and behind them of those who may only watch: neither takes the others'.
#define GW_DRIVERS_MAX  64U
#define GW_WATCHERS_MAX 64U
_Static_assert(GW_DRIVERS_MAX == 64U && GW_WATCHERS_MAX == 64U, "a word has a bit for each slot of one right");

/// Behind them the places of those who come when all others of their socket are taken: a stop is never refused, and nobody is
/// evicted for it. Each is closed after its first line, and has GW_STOP_US for it; of what had come with it, each `stop`, `disarm` and
/// `estop` is carried out. One user but root holds at most half of a
/// socket's places; where they are all taken, one that has been silent for GW_STOP_LEAST_US makes room for the next, so that a
/// thousand silent connections a second leave room for one that says stop a moment after it has come.
#define GW_STOP_PLACES   8U ///< Of each socket.
#define GW_STOP_US       200000U
#define GW_STOP_LEAST_US 5000U

/// A place more of each socket: whoever finds no other has it while its first line is looked for, and no longer.
#define GW_STOP_SLOTS  (GW_STOP_PLACES + 1U)
#define GW_CLIENTS_MAX (GW_DRIVERS_MAX + GW_WATCHERS_MAX + GW_RIGHTS * GW_STOP_SLOTS)

/// What is done for a client beside reading and sending. Each is called with `context`.
typedef struct gw_servant {
    void (*welcome)(void *context, gw_client_t *client); ///< It is connected; who has come only to stop, too.
    /// Of a connection that is being closed only what stops.
    void (*carry_out)(void *context, gw_client_t *client, const char *line, size_t length);
    void (*leave)(void *context, gw_client_t *client); ///< It can hold no lease any more.
    void *context;
} gw_servant_t;

typedef struct gw_clients {
    gw_servant_t servant;
    struct gw_log *log;
    gw_listener_t listener[GW_RIGHTS];
    uint32_t most[GW_RIGHTS];        ///< Connections, by the configuration.
    uint32_t count[GW_PARTS];        ///< The same that are open.
    uint64_t open[GW_PARTS];         ///< The same: a bit for each slot that is taken.
    uint32_t next_served[GW_PARTS];  ///< Slot where the next round begins.
    uint32_t next_flushed[GW_PARTS]; ///< The same of sending.
    iw_client_t last_id;
    iw_time_us_t
        now_us; ///< When the wait of this cycle ended: what a client sends later than this was not waiting then.
    int epoll_fd;
    bool some_wait;          ///< The last round did not reach everybody.
    bool lines_wait;         ///< The same of sending.
    char line[GW_REPLY_MAX]; ///< Where replies and events are written.
    gw_client_t client[GW_CLIENTS_MAX];
} gw_clients_t;

/// The open connection with this number; NULL if it is gone.
gw_client_t *gw_clients_find(gw_clients_t *self, iw_client_t id);

/// Open connections.
uint32_t gw_clients_count(const gw_clients_t *self);

/// The first slot from this one on with an open connection; GW_CLIENTS_MAX: there is none. Free slots cost nothing.
static inline uint32_t gw_clients_from(const gw_clients_t *self, uint32_t slot) {
    uint32_t begin = slot % GW_DRIVERS_MAX;
    for (uint32_t word = slot / GW_DRIVERS_MAX; word < sizeof self->open / sizeof self->open[0]; word++) {
        const uint64_t open = self->open[word] >> begin;
        if (open != 0U) {
            return word * GW_DRIVERS_MAX + begin + (uint32_t)__builtin_ctzll(open);
        }
        begin = 0;
    }
    return GW_CLIENTS_MAX;
}

/// `by` stops the wheels, in this cycle: what others have sent before is not to undo it.
void gw_clients_note_stop(gw_clients_t *self, const gw_client_t *by);

/// A reply that says no.
void gw_clients_refuse(gw_clients_t *self, gw_client_t *client, const iwn_id_t *id, const iwn_refusal_t *refusal);

/// Serving the clients: accept, read, carry out, flush, close. Bounded work for each of them in each cycle.
///
/// What a descriptor in the epoll set stands for; a client's tag is GW_TAG_CLIENT plus its slot.
enum { GW_TAG_SIGNAL = 0, GW_TAG_LISTENER, GW_TAG_WATCH_LISTENER, GW_TAG_BUS, GW_TAG_ESTOP, GW_TAG_BOX, GW_TAG_CLIENT };

/// Lines of one client that are carried out in one cycle.
#define GW_LINES_PER_CYCLE 4U

/// Lines that may be stops, of one client that is being closed.
#define GW_LAST_LINES 16U

/// Connections accepted in one cycle by each socket, and in no more than GW_ROUND_US.
#define GW_ACCEPTS_PER_CYCLE 8U

/// Reading and carrying out, and then sending, take no longer than this each (and one client's turn) in one cycle: the
/// wheels and the e-stop wait for no number of clients.
#define GW_ROUND_US 500U

/// Watchers come behind all who may drive, in what is left of that time (one of them always has a turn). After one
/// turn of several, one line of each is carried out in so long, and so many newcomers as in one cycle are let in: a flood of them, even
/// of `estop`, is as slow as that, and yet a newcomer behind 1000 others in a second waits for a few ms only.
#define GW_WATCHER_LINE_US   10000U
#define GW_WATCHER_ACCEPT_US 2000U

/// What a connection beyond the maximum is refused with, if its first line is no stop or does not come.
void gw_service_refuse_crowd(const gw_clients_t *self, const gw_client_t *client, iwn_refusal_t *out_refusal);

/// Takes newcomers; carries out the stops of those for whom there is no room, and tells the others.
void gw_service_accept(gw_clients_t *self);

/// Reads from the clients that have something to say and carries out their next lines: the holder of the lease first,
/// then the others who may drive, then the watchers, as many as the time allows, the rest in the next cycle.
void gw_service_clients(gw_clients_t *self, iw_client_t holder);

/// The same of this one alone, and before all others.
void gw_service_first(gw_clients_t *self, gw_client_t *client);

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
