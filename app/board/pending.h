// SPDX-License-Identifier: MIT
/// The ids of requests whose answers wait: an arm for its TX confirmation, a status for the long line. One pool for all
/// clients, since an id takes 88 bytes and hardly ever more than one arm waits.
///
/// Pure, no heap. All zero: nobody waits.
#ifndef BRD_PENDING_H
#define BRD_PENDING_H

#include "iwheel/gateway.h"
#include "iwheel_northbound/line.h"
#include "iwheel_northbound/request.h"

/// A status of every channel, and as many arms: one that waits, and one that takes the lease over.
#define BRD_PENDING_ARMS 2U
#define BRD_PENDING_MAX  (IWN_LINE_CHANNELS + BRD_PENDING_ARMS)

typedef struct {
    iw_client_t client; ///< IW_CLIENT_NONE: the place is free.
    iwn_cmd_t cmd;      ///< IWN_CMD_ARM or IWN_CMD_STATUS.
    iwn_id_t id;
} brd_pending_place_t;

typedef struct {
    brd_pending_place_t place[BRD_PENDING_MAX];
} brd_pending_t;

/// True if an answer to this client's `cmd` can wait: one of it waits already, or there is a place.
bool brd_pending_has_room(const brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd);

/// The answer waits, in the place of an earlier one to the same client's `cmd`. Only where there is room.
void brd_pending_put(brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd, const iwn_id_t *id);

/// The answer is given now: its place is free, and the id good until the next `brd_pending_put`. An id of no kind if
/// none waits.
const iwn_id_t *brd_pending_take(brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd);

/// The client is gone: nothing waits for it any more.
void brd_pending_forget(brd_pending_t *self, iw_client_t client);

#endif
