// SPDX-License-Identifier: MIT
#include "pending.h"

#include <stddef.h>

static size_t place_of(const iw_pending_t *self, iw_client_t client, iwn_cmd_t cmd) {
    size_t at = 0;
    while (at < IW_PENDING_MAX && !(self->place[at].client == client && self->place[at].cmd == cmd)) {
        at++;
    }
    return at;
}

/// IW_PENDING_MAX: none. The last places are those of arms, so that neither kind uses up the other's.
static size_t free_place(const iw_pending_t *self, iwn_cmd_t cmd) {
    const bool arms = cmd == IWN_CMD_ARM;
    const size_t end = arms ? IW_PENDING_MAX : IWN_LINE_CHANNELS;
    for (size_t at = arms ? IWN_LINE_CHANNELS : 0U; at < end; at++) {
        if (self->place[at].client == IW_CLIENT_NONE) {
            return at;
        }
    }
    return IW_PENDING_MAX;
}

bool iw_pending_has_room(const iw_pending_t *self, iw_client_t client, iwn_cmd_t cmd) {
    return place_of(self, client, cmd) < IW_PENDING_MAX || free_place(self, cmd) < IW_PENDING_MAX;
}

void iw_pending_put(iw_pending_t *self, iw_client_t client, iwn_cmd_t cmd, const iwn_id_t *id) {
    const size_t known = place_of(self, client, cmd);
    const size_t at = (known < IW_PENDING_MAX) ? known : free_place(self, cmd);
    if (at < IW_PENDING_MAX) {
        self->place[at].client = client;
        self->place[at].cmd = cmd;
        self->place[at].id = *id;
    }
}

const iwn_id_t *iw_pending_take(iw_pending_t *self, iw_client_t client, iwn_cmd_t cmd) {
    static const iwn_id_t none = {.kind = IWN_ID_NONE};
    const size_t at = place_of(self, client, cmd);
    if (at == IW_PENDING_MAX) {
        return &none;
    }
    self->place[at].client = IW_CLIENT_NONE;
    return &self->place[at].id;
}

void iw_pending_forget(iw_pending_t *self, iw_client_t client) {
    for (size_t at = 0; at < IW_PENDING_MAX; at++) {
        if (self->place[at].client == client) {
            self->place[at].client = IW_CLIENT_NONE;
        }
    }
}
