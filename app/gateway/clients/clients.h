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

bool gw_clients_anybody_watches(const gw_clients_t *self, iwn_topic_t topic);

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

#endif
