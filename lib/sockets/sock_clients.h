// SPDX-License-Identifier: MIT
/// Table and service of all connections, and the lines sent to them: replies, refusals, events.
///
/// Each line is written to `line`, one at a time.
#ifndef SOCK_CLIENTS_H
#define SOCK_CLIENTS_H

#include "sock_client.h"

#include "iwheel_northbound/json_out.h"

struct sock_log;

/// Slots of clients that may drive, followed by those of watchers. Neither uses the other's.
#define SOCK_DRIVERS_MAX  64U
#define SOCK_WATCHERS_MAX 64U
_Static_assert(SOCK_DRIVERS_MAX == 64U && SOCK_WATCHERS_MAX == 64U, "a word has a bit for each slot of one right");

/// Further places for clients that arrive when all others of their socket are used, so that a stop is never refused and
/// no client is evicted for it. Such a client is closed after its first line, for which it has SOCK_STOP_US. Each
/// `stop`, `disarm` and `estop` that arrived with that line is executed. A user other than root holds at most half of a
/// socket's places. If all are used, one that has sent nothing for SOCK_STOP_LEAST_US is replaced, so that a thousand
/// idle connections per second leave places for a client that sends a stop shortly after connecting.
#define SOCK_STOP_PLACES   8U ///< Per socket.
#define SOCK_STOP_US       200000U
#define SOCK_STOP_LEAST_US 5000U

/// One more place per socket, used only while the first line of a client without another place is read.
#define SOCK_STOP_SLOTS  (SOCK_STOP_PLACES + 1U)
#define SOCK_CLIENTS_MAX (SOCK_DRIVERS_MAX + SOCK_WATCHERS_MAX + SOCK_RIGHTS * SOCK_STOP_SLOTS)

/// Functions of the owner. Each is called with `context`.
typedef struct sock_handler {
    void (*welcome)(void *context, sock_client_t *client); ///< A client has connected, also one that may only stop.
    /// Executes a line. For a closing connection only stop requests. A line beyond IWN_LINE_MAX has a stop in it, and is
    /// refused with it (iwn_request_read).
    void (*carry_out)(void *context, sock_client_t *client, const char *line, size_t length);
    /// Returns true if the line is a stop request: then it precedes a watcher's earlier lines. NULL: none does.
    bool (*stops)(void *context, const char *line, size_t length);
    void (*leave)(void *context, sock_client_t *client); ///< The client can no longer hold a lease.
    void *context;
} sock_handler_t;

typedef struct sock_clients {
    sock_handler_t handler;
    struct sock_log *log;
    sock_listener_t listener[SOCK_RIGHTS];
    uint32_t most[SOCK_RIGHTS];        ///< Configured number of connections.
    uint32_t count[SOCK_PARTS];        ///< Number of open connections.
    uint64_t open[SOCK_PARTS];         ///< Bit mask of used slots.
    uint32_t next_served[SOCK_PARTS];  ///< First slot of the next round of reading.
    uint32_t next_flushed[SOCK_PARTS]; ///< First slot of the next round of sending.
    iw_client_t last_id;
    iw_time_us_t now_us; ///< Time at which the wait of this cycle ended: later bytes were not waiting then.
    int epoll_fd;
    bool some_wait;            ///< The last round of reading did not reach all clients.
    bool lines_wait;           ///< The last round of sending did not reach all clients.
    char line[SOCK_REPLY_MAX]; ///< Buffer of replies and events.
    sock_client_t client[SOCK_CLIENTS_MAX];
} sock_clients_t;

/// Returns the open connection with this id; NULL if it is gone.
sock_client_t *sock_clients_find(sock_clients_t *self, iw_client_t id);

/// Returns the number of open connections.
uint32_t sock_clients_count(const sock_clients_t *self);

/// Returns the first slot with an open connection, from this slot on; SOCK_CLIENTS_MAX if there is none. Free slots
/// cost nothing.
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

/// Records that `by` stops the wheels in this cycle, so that earlier requests of other clients do not undo it.
void sock_clients_note_stop(sock_clients_t *self, const sock_client_t *by);

/// Sends a refusal.
void sock_clients_refuse(sock_clients_t *self, sock_client_t *client, const iwn_id_t *id, const iwn_refusal_t *refusal);

/// Service of the clients: accept, read, execute, send, close. The work per client and cycle is limited.
///
/// Tags of descriptors in the epoll set. The tag of a client is SOCK_TAG_CLIENT plus its slot.
enum {
    SOCK_TAG_SIGNAL = 0,
    SOCK_TAG_LISTENER,
    SOCK_TAG_WATCH_LISTENER,
    SOCK_TAG_BUS,
    SOCK_TAG_ESTOP,
    SOCK_TAG_BOX,
    SOCK_TAG_CLIENT
};

/// Number of lines of one client that are executed in one cycle.
#define SOCK_LINES_PER_CYCLE 4U

/// Number of lines of a closing client that are searched for stop requests.
#define SOCK_LAST_LINES 16U
/// Number of reads of such a client's lines that were not read before. Each reads at least half of IWN_LINE_MAX while
/// more is there, so together more than the default buffer of a socket in Linux (net.core.wmem_default, 208 KiB).
#define SOCK_LAST_READS 128U

/// Number of connections that each socket accepts in one cycle, within SOCK_ROUND_US.
#define SOCK_ACCEPTS_PER_CYCLE 8U

/// Longest time of reading and executing in one cycle, and of sending, plus one client's turn. The wheels and the
/// e-stop never wait for the number of clients.
#define SOCK_ROUND_US 500U

/// Watchers use the rest of that time after all clients that may drive; one of them always has a turn. After a turn of
/// several lines, one line per watcher is executed in this time, and as many newcomers as in one cycle are accepted. A
/// flood, even of `estop`, is limited to that rate, and a newcomer after 1000 others in a second waits for a few ms
/// only.
#define SOCK_WATCHER_LINE_US   10000U
#define SOCK_WATCHER_ACCEPT_US 2000U

/// Refuses a connection beyond the maximum whose first line is not a stop request or does not arrive.
void sock_service_refuse_crowd(const sock_clients_t *self, const sock_client_t *client, iwn_refusal_t *out_refusal);

struct epoll_event;

/// Records the result of the wait for a client: an event with the tag of its slot.
void sock_service_note(sock_clients_t *self, const struct epoll_event *event);

/// Accepts connections. It executes the stop requests of those without a place, and refuses the others.
void sock_service_accept(sock_clients_t *self);

/// Reads from clients that have sent something and executes their next lines: first the lease holder, then the others
/// that may drive, then the watchers, as many as the time allows. The rest follows in the next cycle.
void sock_service_clients(sock_clients_t *self, iw_client_t holder);

/// Does the same for this client only, before all others.
void sock_service_first(sock_clients_t *self, sock_client_t *client);

/// Sends queued lines, closes finished connections, and updates epoll, in the same order and within the same time.
void sock_service_flush(sock_clients_t *self, iw_client_t holder);

/// Executes the client's stop requests, also those still in its socket, ends its lease, and closes it after it has
/// received its queue.
void sock_service_finish(sock_clients_t *self, sock_client_t *client);

/// Returns true if a client waits, so that the next wait must not sleep.
bool sock_service_is_busy(const sock_clients_t *self);

/// Returns the time of the next event without input: a connection to close, or the next accept.
iw_time_us_t sock_service_next_us(const sock_clients_t *self);

/// Closes every connection at the end.
void sock_service_close_all(sock_clients_t *self);

#endif
