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
#define GW_CLIENTS_MAX  (GW_DRIVERS_MAX + GW_WATCHERS_MAX)
_Static_assert(GW_DRIVERS_MAX == 64U && GW_WATCHERS_MAX == 64U, "a word has a bit for each slot of one right");

/// What is done for a client beside reading and sending. Each is called with `context`.
typedef struct gw_servant {
    void (*welcome)(void *context, gw_client_t *client);
    void (*carry_out)(void *context, gw_client_t *client, const char *line, size_t length);
    void (*leave)(void *context, gw_client_t *client); ///< It can hold no lease any more.
    void *context;
} gw_servant_t;

typedef struct gw_clients {
    gw_servant_t servant;
    struct gw_log *log;
    gw_listener_t listener[GW_RIGHTS];
    uint32_t most[GW_RIGHTS];         ///< Connections, by the configuration.
    uint32_t count[GW_RIGHTS];        ///< The same that are open.
    uint64_t open[GW_RIGHTS];         ///< The same: a bit for each slot that is taken.
    uint32_t next_served[GW_RIGHTS];  ///< Slot where the next round begins.
    uint32_t next_flushed[GW_RIGHTS]; ///< The same of sending.
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
    for (; slot < GW_CLIENTS_MAX; slot = (slot / GW_DRIVERS_MAX + 1U) * GW_DRIVERS_MAX) {
        const uint64_t open = self->open[slot / GW_DRIVERS_MAX] >> (slot % GW_DRIVERS_MAX);
        if (open != 0U) {
            return slot + (uint32_t)__builtin_ctzll(open);
        }
    }
    return GW_CLIENTS_MAX;
}

/// How many watch it.
uint32_t gw_clients_watching(const gw_clients_t *self, iwn_topic_t topic);

/// `by` stops the wheels, in this cycle: what others have sent before is not to undo it.
void gw_clients_note_stop(gw_clients_t *self, const gw_client_t *by);

/// An event, with its name.
iwn_out_t gw_clients_begin_event(gw_clients_t *self, const char *name);

/// Closes it and sends it to all who watch its topic. Whoever reads too slowly loses it; one that does not fit `line` is sent to
/// nobody.
void gw_clients_send_event(gw_clients_t *self, iwn_out_t *json, iwn_topic_t topic);

/// A reply that says yes, open for its fields.
iwn_out_t gw_clients_begin_reply(gw_clients_t *self, const iwn_id_t *id);

/// Closes it and sends it.
void gw_clients_send_reply(gw_client_t *client, iwn_out_t *json);

/// A reply that says no.
void gw_clients_refuse(gw_clients_t *self, gw_client_t *client, const iwn_id_t *id, const iwn_refusal_t *refusal);

/// The same without a client: leaves it in `line`, returns its length.
size_t gw_clients_write_refusal(gw_clients_t *self, const iwn_id_t *id, const iwn_refusal_t *refusal);

/// Serving the clients: accept, read, carry out, flush, close. Bounded work for each of them in each cycle.
///
/// What a descriptor in the epoll set stands for; a client's tag is GW_TAG_CLIENT plus its slot.
enum { GW_TAG_SIGNAL = 0, GW_TAG_LISTENER, GW_TAG_WATCH_LISTENER, GW_TAG_BUS, GW_TAG_ESTOP, GW_TAG_BOX, GW_TAG_CLIENT };

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
