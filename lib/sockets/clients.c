// SPDX-License-Identifier: MIT
#include "clients.h"

#include "iwheel_northbound/tell.h"

gw_client_t *gw_clients_find(gw_clients_t *self, iw_client_t id) {
    for (uint32_t i = gw_clients_from(self, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(self, i + 1U)) {
        if (self->client[i].id == id) {
            return &self->client[i];
        }
    }
    return NULL;
}

uint32_t gw_clients_count(const gw_clients_t *self) {
    return self->count[GW_DRIVE] + self->count[GW_WATCH];
}

void gw_clients_note_stop(gw_clients_t *self, const gw_client_t *by) {
    for (uint32_t i = gw_clients_from(self, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(self, i + 1U)) {
        gw_client_t *client = &self->client[i];
        if (client != by) {
            client->stopped_us = self->now_us;
        }
    }
}

static bool watches(const gw_client_t *client, iwn_topic_t topic) {
    return (client->topics & (1U << topic)) != 0U;
}

uint32_t gw_clients_watching(const gw_clients_t *self, iwn_topic_t topic) {
    uint32_t count = 0;
    for (uint32_t i = gw_clients_from(self, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(self, i + 1U)) {
        count += watches(&self->client[i], topic) ? 1U : 0U;
    }
    return count;
}

iwn_out_t gw_clients_begin_event(gw_clients_t *self, const char *name) {
    return iwn_tell_event(self->line, sizeof self->line, name);
}

void gw_clients_send_event(gw_clients_t *self, iwn_out_t *json, iwn_topic_t topic) {
    iwn_out_close(json, '}');
    const size_t length = iwn_out_finish(json);
    for (uint32_t i = (length > 0U) ? gw_clients_from(self, 0U) : GW_CLIENTS_MAX; i < GW_CLIENTS_MAX;
         i = gw_clients_from(self, i + 1U)) {
        if (watches(&self->client[i], topic)) {
            gw_client_event(&self->client[i], json->data, length);
        }
    }
}

iwn_out_t gw_clients_begin_reply(gw_clients_t *self, const iwn_id_t *id) {
    return iwn_tell_reply(self->line, sizeof self->line, id, true);
}

void gw_clients_send_reply(gw_client_t *client, iwn_out_t *json) {
    iwn_out_close(json, '}');
    gw_client_reply(client, json->data, iwn_out_finish(json));
}

void gw_clients_refuse(gw_clients_t *self, gw_client_t *client, const iwn_id_t *id, const iwn_refusal_t *refusal) {
    gw_client_reply(client, self->line, iwn_tell_refusal(self->line, sizeof self->line, id, refusal));
}
