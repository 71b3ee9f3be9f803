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

void gw_clients_refuse(gw_clients_t *self, gw_client_t *client, const iwn_id_t *id, const iwn_refusal_t *refusal) {
    gw_client_reply(client, self->line, iwn_tell_refusal(self->line, sizeof self->line, id, refusal));
}
