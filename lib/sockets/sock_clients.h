// SPDX-License-Identifier: MIT
/// The table of all connections, who serves them, and the lines that they are sent: replies, refusals, events.
///
/// A line is written in `line`, one at a time.
#ifndef SOCK_CLIENTS_H
#define SOCK_CLIENTS_H

#include "sock_client.h"

#include "iwheel_northbound/json_out.h"

struct sock_log;

/// Slots of those who may drive, and behind them of those who may only watch: neither takes the others'.
#define SOCK_DRIVERS_MAX  64U
#define SOCK_WATCHERS_MAX 64U
_Static_assert(SOCK_DRIVERS_MAX == 64U && SOCK_WATCHERS_MAX == 64U, "a word has a bit for each slot of one right");

/// Behind them the places of those who come when all others of their socket are taken: a stop is never refused, and nobody is
/// evicted for it. Each is closed after its first line, and has SOCK_STOP_US for it; of what had come with it, each `stop`, `disarm` and
/// `estop` is carried out. One user but root holds at most half of a
/// socket's places; where they are all taken, one that has been silent for SOCK_STOP_LEAST_US makes room for the next, so that a
/// thousand silent connections a second leave room for one that says stop a moment after it has come.
#define SOCK_STOP_PLACES   8U ///< Of each socket.
#define SOCK_STOP_US       200000U
#define SOCK_STOP_LEAST_US 5000U

/// A place more of each socket: whoever finds no other has it while its first line is looked for, and no longer.
#define SOCK_STOP_SLOTS  (SOCK_STOP_PLACES + 1U)
#define SOCK_CLIENTS_MAX (SOCK_DRIVERS_MAX + SOCK_WATCHERS_MAX + SOCK_RIGHTS * SOCK_STOP_SLOTS)

/// What is done for a client beside reading and sending. Each is called with `context`.
typedef struct sock_handler {
    void (*welcome)(void *context, sock_client_t *client); ///< It is connected; who has come only to stop, too.
    /// Of a connection that is being closed only what stops.
    void (*carry_out)(void *context, sock_client_t *client, const char *line, size_t length);
    void (*leave)(void *context, sock_client_t *client); ///< It can hold no lease any more.
    void *context;
} sock_handler_t;

typedef struct sock_clients {
    sock_handler_t handler;
    struct sock_log *log;
    sock_listener_t listener[SOCK_RIGHTS];
    uint32_t most[SOCK_RIGHTS];        ///< Connections, by the configuration.
    uint32_t count[SOCK_PARTS];        ///< The same that are open.
    uint64_t open[SOCK_PARTS];         ///< The same: a bit for each slot that is taken.
    uint32_t next_served[SOCK_PARTS];  ///< Slot where the next round begins.
    uint32_t next_flushed[SOCK_PARTS]; ///< The same of sending.
    iw_client_t last_id;
    iw_time_us_t
        now_us; ///< When the wait of this cycle ended: what a client sends later than this was not waiting then.
    int epoll_fd;
    bool some_wait;            ///< The last round did not reach everybody.
    bool lines_wait;           ///< The same of sending.
    char line[SOCK_REPLY_MAX]; ///< Where replies and events are written.
    sock_client_t client[SOCK_CLIENTS_MAX];
} sock_clients_t;

/// The open connection with this number; NULL if it is gone.
sock_client_t *sock_clients_find(sock_clients_t *self, iw_client_t id);

/// Open connections.
uint32_t sock_clients_count(const sock_clients_t *self);

/// The first slot from this one on with an open connection; SOCK_CLIENTS_MAX: there is none. Free slots cost nothing.
static inline uint32_t sock_clients_from(const sock_clients_t *self, uint32_t slot) {
    uint32_t begin = slot % SOCK_DRIVERS_MAX;
    for (uint32_t word = slot / SOCK_DRIVERS_MAX; word < sizeof self->open / sizeof self->open[0]; word++) {
        const uint64_t open = self->open[word] >> begin;
        if (open != 0U) {
            return word * SOCK_DRIVERS_MAX + begin + (uint32_t)__builtin_ctzll(open);
        }
        begin = 0;
    }
    return SOCK_CLIENTS_MAX;
}

/// `by` stops the wheels, in this cycle: what others have sent before is not to undo it.
void sock_clients_note_stop(sock_clients_t *self, const sock_client_t *by);

/// A reply that says no.
void sock_clients_refuse(sock_clients_t *self, sock_client_t *client, const iwn_id_t *id, const iwn_refusal_t *refusal);

/// Serving the clients: accept, read, carry out, flush, close. Bounded work for each of them in each cycle.
///
/// What a descriptor in the epoll set stands for; a client's tag is SOCK_TAG_CLIENT plus its slot.
enum {
    SOCK_TAG_SIGNAL = 0,
    SOCK_TAG_LISTENER,
    SOCK_TAG_WATCH_LISTENER,
    SOCK_TAG_BUS,
    SOCK_TAG_ESTOP,
    SOCK_TAG_BOX,
    SOCK_TAG_CLIENT
};

/// Lines of one client that are carried out in one cycle.
#define SOCK_LINES_PER_CYCLE 4U

/// Lines that may be stops, of one client that is being closed.
#define SOCK_LAST_LINES 16U

/// Connections accepted in one cycle by each socket, and in no more than SOCK_ROUND_US.
#define SOCK_ACCEPTS_PER_CYCLE 8U

/// Reading and carrying out, and then sending, take no longer than this each (and one client's turn) in one cycle: the
/// wheels and the e-stop wait for no number of clients.
#define SOCK_ROUND_US 500U

/// Watchers come behind all who may drive, in what is left of that time (one of them always has a turn). After one
/// turn of several, one line of each is carried out in so long, and so many newcomers as in one cycle are let in: a flood of them, even
/// of `estop`, is as slow as that, and yet a newcomer behind 1000 others in a second waits for a few ms only.
#define SOCK_WATCHER_LINE_US   10000U
#define SOCK_WATCHER_ACCEPT_US 2000U

/// What a connection beyond the maximum is refused with, if its first line is no stop or does not come.
void sock_service_refuse_crowd(const sock_clients_t *self, const sock_client_t *client, iwn_refusal_t *out_refusal);

/// Takes newcomers; carries out the stops of those for whom there is no room, and tells the others.
void sock_service_accept(sock_clients_t *self);

/// Reads from the clients that have something to say and carries out their next lines: the holder of the lease first,
/// then the others who may drive, then the watchers, as many as the time allows, the rest in the next cycle.
void sock_service_clients(sock_clients_t *self, iw_client_t holder);

/// The same of this one alone, and before all others.
void sock_service_first(sock_clients_t *self, sock_client_t *client);

/// Sends what is queued, closes what is finished, and tells epoll what to watch next. In the same order, within the
/// same time.
void sock_service_flush(sock_clients_t *self, iw_client_t holder);

/// True if somebody waits for us: the next wait must not sleep.
bool sock_service_is_busy(const sock_clients_t *self);

/// When something is due although nobody says anything: a connection to be closed, accepting to be taken up again.
iw_time_us_t sock_service_next_us(const sock_clients_t *self);

/// Closes every connection, at the end.
void sock_service_close_all(sock_clients_t *self);

#endif
