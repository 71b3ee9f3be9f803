// SPDX-License-Identifier: MIT
/// The one connection to the gateway: kept up for ever, asked without waiting, and listened to.
///
///     AWAY --found--> HERE --lost--> AWAY, tried again after 0.1 s to 2 s
///
/// Nothing waits but the making of a connection, WEB_GREETING_MS at most. Nothing is asked twice.
#ifndef IW_WEB_LINK_H
#define IW_WEB_LINK_H

#include "feed.h"
#include "iwheel_client/client.h"

#include <stdio.h>

#define WEB_GREETING_MS 200
/// After this an answer does not count any more.
#define WEB_ANSWER_US 1000000U
/// A stop that is not answered by then was not delivered, and the connection is closed, which stops the wheels if the lease was ours.
#define WEB_STOP_US    400000U
#define WEB_ASKED_MAX  64U
#define WEB_STOPS_KEPT 16U

/// The gateway's reply; NULL: there was none in time. Valid during the call.
typedef void (*web_answer_t)(void *context, const iwc_message_t *reply);

typedef struct {
    int64_t id; ///< 0: this place is free.
    uint64_t until_us;
    bool is_stop;
    web_answer_t answer;
    void *context;
} web_question_t;

typedef struct {
    iwc_t *gateway;
    const char *socket;
    unsigned rate_hz;
    bool drives; ///< It must have the right to drive.
    bool is_here;
    bool told_away;       ///< That it is not here.
    uint64_t try_us;      ///< When to connect next.
    uint64_t wait_us;     ///< Between two tries.
    uint64_t denied_us;   ///< Since when the socket may not be used; 0: it may.
    uint64_t why_us;      ///< When to ask why it stopped; 0: no need.
    uint64_t stop_number; ///< Of the newest in `stops`.
    uint64_t state_us;    ///< When the newest state came.
    uint64_t connections;
    uint64_t random;
    char *state; ///< The newest, as it came; NULL: not known.
    size_t state_length;
    char *stops[WEB_STOPS_KEPT]; ///< Replies to `why`, the newest first.
    web_question_t asked[WEB_ASKED_MAX];
    web_feed_t feed;
} web_link_t;

/// False: no memory.
bool web_link_open(web_link_t *self, const char *socket, unsigned rate_hz, bool drives);
void web_link_close(web_link_t *self);

/// Connects, reads, and gives up what was not answered. 0; or 77: the rights are missing, with a line on stderr.
int web_link_step(web_link_t *self, uint64_t now_us);

/// When `step` has something to do, whatever comes.
uint64_t web_link_next_us(const web_link_t *self, uint64_t now_us);

/// For poll(); -1: nothing to wait for.
int web_link_fd(const web_link_t *self);

/// Asks; `answer` is called later, once, unless `context` is forgotten before. False: it could not be asked.
bool web_link_ask(web_link_t *self, const char *request, web_answer_t answer, void *context, uint64_t now_us);

/// Nobody wants the answers for this context any more.
void web_link_forget(web_link_t *self, const void *context);

/// The newest state as a message; false: not known, or older than two seconds.
bool web_link_state(const web_link_t *self, uint64_t now_us, iwc_message_t *out_state);

#endif
