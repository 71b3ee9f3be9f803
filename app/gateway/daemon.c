// SPDX-License-Identifier: MIT
#include "daemon.h"

gw_client_t *gw_daemon_client(gw_daemon_t *self, iw_client_t id) {
    for (uint32_t i = 0; i < GW_CLIENTS_MAX && id != IW_CLIENT_NONE; i++) {
        if (self->client[i].id == id) {
            return &self->client[i];
        }
    }
    return NULL;
}

iw_snapshot_t gw_daemon_look(const gw_daemon_t *self) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(&self->gateway, self->now_us, &seen);
    return seen;
}

bool gw_daemon_is_sending(const gw_daemon_t *self) {
    return iw_gateway_is_sending(&self->gateway);
}
