// SPDX-License-Identifier: MIT
/// Ids of requests whose replies wait: an arm for its TX confirmation, a status for the long line. All clients share
/// one pool, because an id needs 80 bytes, and more than one arm rarely waits.
///
/// Pure, no heap. All zero: no reply waits.
#ifndef BRD_PENDING_H
#define BRD_PENDING_H

#include "iwheel/gateway.h"
#include "iwheel_northbound/line.h"
#include "iwheel_northbound/request.h"

/// One status for every channel, and two arms: one that waits, and one of a takeover.
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

/// Returns true if the reply to this client's `cmd` can wait: one already waits, or a place is free.
bool brd_pending_has_room(const brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd);

/// Stores the id of a reply that waits. It replaces that of an earlier one to the same client and `cmd`. Call it only
/// if a place is free.
void brd_pending_put(brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd, const iwn_id_t *id);

/// Removes a waiting reply and returns its id, which is valid until the next `brd_pending_put`. Returns an id of kind
/// IWN_ID_NONE if none waits.
const iwn_id_t *brd_pending_take(brd_pending_t *self, iw_client_t client, iwn_cmd_t cmd);

/// Removes the waiting replies of a client that has disconnected.
void brd_pending_forget(brd_pending_t *self, iw_client_t client);

#endif
