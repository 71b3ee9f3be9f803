// SPDX-License-Identifier: MIT
// Lines to clients, and queries about clients.
#include "server_calls.h"

#include <string.h>

void iwn_server_welcome(iwn_client_t *client, iw_client_t id, bool watches_only) {
    memset(client, 0, sizeof *client);
    client->id = id;
    client->watches_only = watches_only;
    client->rate_hz = IWN_RATE_DEFAULT_HZ;
}

const iw_snapshot_t *iwn_server_snapshot(iwn_server_t *self) {
    iw_gateway_snapshot(self->core, self->now_us, &self->seen);
    return &self->seen;
}

iwn_client_t *iwn_server_find(iwn_server_t *self, iw_client_t id) {
    iwn_client_t *client = (id == IW_CLIENT_NONE) ? NULL : iwn_target_next(self, NULL);
    while (client != NULL && client->id != id) {
        client = iwn_target_next(self, client);
    }
    return client;
}

static bool watches(const iwn_client_t *client, iwn_topic_t topic) {
    return (client->topics & (1U << topic)) != 0U;
}

uint32_t iwn_server_watching(iwn_server_t *self, iwn_topic_t topic) {
    uint32_t count = 0;
    for (iwn_client_t *client = iwn_target_next(self, NULL); client != NULL; client = iwn_target_next(self, client)) {
        count += watches(client, topic) ? 1U : 0U;
    }
    return count;
}

iwn_out_t iwn_server_begin_reply(iwn_server_t *self, const iwn_id_t *id) {
    size_t size = 0;
    char *const line = iwn_target_line(self, &size);
    return iwn_write_reply(line, size, id, true);
}

void iwn_server_send_reply(iwn_server_t *self, iwn_client_t *client, iwn_out_t *json) {
    iwn_out_close(json, '}');
    iwn_target_reply(self, client, json->data, iwn_out_finish(json));
}

void iwn_server_refuse(iwn_server_t *self, iwn_client_t *client, const iwn_id_t *id) {
    size_t size = 0;
    char *const line = iwn_target_line(self, &size);
    iwn_target_reply(self, client, line, iwn_write_refusal(line, size, id, &self->refusal));
}

iwn_out_t iwn_server_begin_event(iwn_server_t *self, const char *name) {
    size_t size = 0;
    char *const line = iwn_target_line(self, &size);
    return iwn_write_event(line, size, name);
}

/// Ends an event and sends it to the watchers of the topic.
static void send_event(iwn_server_t *self, iwn_topic_t topic, bool due_only, iwn_out_t *json) {
    iwn_out_close(json, '}');
    const size_t length = iwn_out_finish(json);
    for (iwn_client_t *client = iwn_target_next(self, NULL); client != NULL; client = iwn_target_next(self, client)) {
        if (watches(client, topic) && (client->due || !due_only)) {
            iwn_target_event(self, client, json->data, length);
        }
    }
}

void iwn_server_send_event(iwn_server_t *self, iwn_topic_t topic, iwn_out_t *json) {
    send_event(self, topic, false, json);
}

void iwn_server_write_hello(iwn_server_t *self, const iwn_client_t *client, iwn_out_t *json) {
    iwn_write_hello(
        &(iwn_hello_t){self->version, self->bus, iw_gateway_state(self->core), client->id, client->watches_only}, json);
}

void iwn_server_hello(iwn_server_t *self, iwn_client_t *client) {
    iwn_out_t json = iwn_server_begin_event(self, "hello");
    iwn_server_write_hello(self, client, &json);
    iwn_out_int(&json, "t_us", (int64_t)self->now_us);
    iwn_server_send_reply(self, client,
                          &json); // A client waits for it before it sends anything, so it must not be lost.
}

void iwn_server_write_status(iwn_server_t *self, const iw_snapshot_t *seen, iwn_out_t *json) {
    const iwn_surroundings_t around = iwn_target_around(self, seen);
    iwn_write_machine(seen, &around, json);
    iwn_target_write_assumptions(self, seen, json);
    iwn_write_rest(seen, &around, json);
}

static bool is_periodic(const iwn_client_t *client) {
    return (client->topics & ((1U << IWN_TOPIC_STATE) | (1U << IWN_TOPIC_FORCE))) != 0U;
}

/// Returns the next time without a burst after a stall.
static iw_time_us_t next_of(const iwn_server_t *self, const iwn_client_t *client) {
    const iw_time_us_t period_us = 1000000U / client->rate_hz;
    const iw_time_us_t own_us = client->next_us + period_us;
    if (!self->each_for_itself) {
        return self->now_us - self->now_us % period_us + period_us;
    }
    return (own_us > self->now_us) ? own_us : self->now_us + period_us;
}

/// Returns the topics of periodic events that are due.
static uint8_t find_due(iwn_server_t *self) {
    uint8_t topics = 0;
    for (iwn_client_t *client = iwn_target_next(self, NULL); client != NULL; client = iwn_target_next(self, client)) {
        client->due = is_periodic(client) && self->now_us >= client->next_us;
        if (client->due) {
            client->next_us = next_of(self, client);
            topics |= client->topics;
        }
    }
    return topics;
}

/// Written once for all clients that are due and watch it.
static void send_force(iwn_server_t *self, const iw_snapshot_t *seen) {
    const iwn_surroundings_t around = iwn_target_around(self, seen);
    iwn_out_t json = iwn_server_begin_event(self, "force");
    iwn_write_force(seen, &around, &json);
    send_event(self, IWN_TOPIC_FORCE, true, &json);
}

void iwn_server_periodic(iwn_server_t *self) {
    const uint8_t topics = find_due(self);
    if ((topics & (1U << IWN_TOPIC_STATE)) != 0U) {
        iwn_target_state(self, iwn_server_snapshot(self), true);
    }
    if ((topics & (1U << IWN_TOPIC_FORCE)) != 0U) {
        send_force(self, iwn_server_snapshot(self));
    }
}

iw_time_us_t iwn_server_next_us(iwn_server_t *self) {
    iw_time_us_t next_us = IW_NEVER;
    for (iwn_client_t *client = iwn_target_next(self, NULL); client != NULL; client = iwn_target_next(self, client)) {
        if (is_periodic(client) && client->next_us < next_us) {
            next_us = client->next_us;
        }
    }
    return next_us;
}
