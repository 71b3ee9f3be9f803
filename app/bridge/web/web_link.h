// SPDX-License-Identifier: MIT
/// Data of the gateway for the page: its newest state, its events and the last stops; and the connection to it.
#ifndef WEB_LINK_H
#define WEB_LINK_H

#include "common/bridge_link.h"
#include "common/lease.h"
#include "feed.h"
#include "tally.h"

#define WEB_STOPS_STORED 16U

typedef struct {
    bridge_link_t gateway;
    bridge_lease_t lease; ///< Lease of the person who drives through this bridge.
    unsigned rate_hz;     ///< Rate of the event `state` while a client reads it; otherwise 2 Hz.
    uint64_t polled_us;   ///< Time of the last read of the state by a client. The reader sets it.
    uint64_t why_us;      ///< Time of the next request `why`; 0: none.
    uint64_t stop_number; ///< Number of the newest stop in `stops`.
    uint64_t state_us;    ///< Time of the newest state.
    char *state;          ///< Newest state, as received; NULL: unknown.
    size_t state_length;
    char *stops[WEB_STOPS_STORED]; ///< Replies to `why`, newest first.
    web_feed_t feed;
    web_tally_t tally;
} web_link_t;

/// Returns false if there is no memory. It must not be moved.
bool web_link_open(web_link_t *self, const char *socket, unsigned rate_hz, bool drives);
void web_link_close(web_link_t *self);

/// Returns the newest state with `ok`, like the reply to `status`; NULL if it is unknown. The caller frees it.
char *web_link_status(const web_link_t *self, uint64_t now_us, size_t *out_length);

/// Like `bridge_link_step` and `bridge_link_next_us`.
int web_link_step(web_link_t *self, uint64_t now_us);
uint64_t web_link_next_us(const web_link_t *self, uint64_t now_us);

/// Writes the newest state as a message. Returns false if it is unknown, or older than two seconds.
bool web_link_state(const web_link_t *self, uint64_t now_us, iwc_message_t *out_state);

#endif
