// SPDX-License-Identifier: MIT
/// What the page is told of the gateway: its newest state, what happens, the last stops. And the connection to it.
#ifndef WEB_LINK_H
#define WEB_LINK_H

#include "common/bridge_link.h"
#include "common/lease.h"
#include "feed.h"
#include "tally.h"

#define WEB_STOPS_STORED 16U

typedef struct {
    bridge_link_t gateway;
    bridge_lease_t lease; ///< Of the person who drives by this bridge.
    unsigned rate_hz;     ///< Of the event `state` while a client reads it; otherwise 2 Hz. Other events do not wait.
    uint64_t looked_us;   ///< Time of the last read of the state by a client. Its readers set it.
    uint64_t why_us;      ///< When to ask why it stopped; 0: no need.
    uint64_t stop_number; ///< Of the newest in `stops`.
    uint64_t state_us;    ///< When the newest state came.
    char *state;          ///< The newest, as it came; NULL: not known.
    size_t state_length;
    char *stops[WEB_STOPS_STORED]; ///< Replies to `why`, the newest first.
    web_feed_t feed;
    web_tally_t tally;
} web_link_t;

/// False: no memory. It must not be moved afterwards.
bool web_link_open(web_link_t *self, const char *socket, unsigned rate_hz, bool drives);
void web_link_close(web_link_t *self);

/// The newest state with its answer of yes, as the reply to `status` has it; NULL: not known. To be freed.
char *web_link_status(const web_link_t *self, uint64_t now_us, size_t *out_length);

/// As `bridge_link_step`, `bridge_link_next_us`.
int web_link_step(web_link_t *self, uint64_t now_us);
uint64_t web_link_next_us(const web_link_t *self, uint64_t now_us);

/// The newest state as a message; false: not known, or older than two seconds.
bool web_link_state(const web_link_t *self, uint64_t now_us, iwc_message_t *out_state);

#endif
