// SPDX-License-Identifier: MIT
#include "pending.h"

#include <stddef.h>

static size_t place_of(const brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd) {
    size_t at = 0;
    while (at < BRD_PENDING_MAX && !(self->place[at].client == client && self->place[at].cmd == cmd)) {
        at++;
    }
    return at;
}

/// Returns BRD_PENDING_MAX if no place is free. The last places are for arms, so that neither kind uses up the places
/// of the other.
static size_t free_place(const brd_pending_t *self, iwn_cmd_t cmd) {
    const bool arms = cmd == IWN_CMD_ARM;
    const size_t end = arms ? BRD_PENDING_MAX : IWN_LINE_CHANNELS;
    for (size_t at = arms ? IWN_LINE_CHANNELS : 0U; at < end; at++) {
        if (self->place[at].client == IW_CLIENT_NONE) {
            return at;
        }
    }
    return BRD_PENDING_MAX;
}

bool brd_pending_has_room(const brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd) {
    return place_of(self, client, cmd) < BRD_PENDING_MAX || free_place(self, cmd) < BRD_PENDING_MAX;
}

void brd_pending_put(brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd, const iwn_id_t *id) {
    const size_t known = place_of(self, client, cmd);
    const size_t at = (known < BRD_PENDING_MAX) ? known : free_place(self, cmd);
    if (at < BRD_PENDING_MAX) {
        self->place[at].client = client;
        self->place[at].cmd = cmd;
        self->place[at].id = *id;
    }
}

const iwn_id_t *brd_pending_take(brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd) {
    static const iwn_id_t none = {.kind = IWN_ID_NONE};
    const size_t at = place_of(self, client, cmd);
    if (at == BRD_PENDING_MAX) {
        return &none;
    }
    self->place[at].client = IW_CLIENT_NONE;
    return &self->place[at].id;
}

void brd_pending_forget(brd_pending_t *self, iw_client_t client) {
    for (size_t at = 0; at < BRD_PENDING_MAX; at++) {
        if (self->place[at].client == client) {
            self->place[at].client = IW_CLIENT_NONE;
        }
    }
}
