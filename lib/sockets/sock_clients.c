// SPDX-License-Identifier: MIT
#include "sock_clients.h"

#include "iwheel_northbound/contents.h"

sock_client_t *sock_clients_find(sock_clients_t *self, iw_client_t id) {
    for (uint32_t i = sock_clients_from(self, 0U); i < SOCK_CLIENTS_MAX; i = sock_clients_from(self, i + 1U)) {
        if (self->client[i].id == id) {
            return &self->client[i];
        }
    }
    return NULL;
}

uint32_t sock_clients_count(const sock_clients_t *self) {
    return self->count[SOCK_DRIVE] + self->count[SOCK_WATCH];
}

void sock_clients_note_stop(sock_clients_t *self, const sock_client_t *by) {
    for (uint32_t i = sock_clients_from(self, 0U); i < SOCK_CLIENTS_MAX; i = sock_clients_from(self, i + 1U)) {
        sock_client_t *client = &self->client[i];
        if (client != by) {
            client->stopped_us = self->now_us;
        }
    }
}

void sock_clients_refuse(sock_clients_t *self, sock_client_t *client, const iwn_id_t *id,
                         const iwn_refusal_t *refusal) {
    sock_client_reply(client, self->line, iwn_write_refusal(self->line, sizeof self->line, id, refusal));
}
