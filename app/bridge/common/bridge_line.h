// SPDX-License-Identifier: MIT
/// One connection of a bridge to the gateway, and the requests on it that have no reply yet. No call waits.
///
///     AWAY --connect--> GREETING --hello--> HERE
///       ^                  |                 |
///       +--- refused, no hello, closed, drop-+
///
/// The owner decides when to connect again. One thread.
#ifndef BRIDGE_LINE_H
#define BRIDGE_LINE_H

#include "iwheel_client/client.h"

/// Requests without reply on one line: the gateway reads as many from a watcher at once.
#define BRIDGE_LINE_MAX 4U
/// The gateway's greeting comes within this time, or the line is dropped.
#define BRIDGE_GREETING_US 500000U
/// Longest request of a bridge with its terminator.
#define BRIDGE_REQUEST_SIZE 1200U

/// The gateway's reply; NULL: there was none in time. Valid during the call.
typedef void (*bridge_answer_t)(void *context, const iwc_message_t *reply);

typedef enum { BRIDGE_AWAY, BRIDGE_GREETING, BRIDGE_HERE } bridge_line_state_t;

/// A request that is on its way.
typedef struct {
    int64_t id; ///< 0: this place is free.
    uint64_t until_us;
    bridge_answer_t answer; ///< NULL: the reply is not needed.
    void *context;
} bridge_sent_t;

typedef struct {
    const char *socket; ///< Outlives the line.
    int epoll_fd;       ///< Watches the descriptor; belongs to the owner.
    iwc_t *gateway;
    bridge_line_state_t state;
    iwc_result_t result; ///< Why the line is AWAY.
    int greeting_fd;     ///< GREETING: connected, not greeted yet.
    uint64_t greeting_until_us;
    bridge_sent_t sent[BRIDGE_LINE_MAX];
} bridge_line_t;

/// Not connected yet. False: no memory.
bool bridge_line_open(bridge_line_t *self, const char *socket, int epoll_fd);
void bridge_line_close(bridge_line_t *self);

/// Begins to connect an AWAY line. False, with `result`: the socket takes no connection now.
bool bridge_line_connect(bridge_line_t *self, uint64_t now_us);

/// Drops the connection; each request without reply is answered with NULL.
void bridge_line_drop(bridge_line_t *self, iwc_result_t why);

/// Reads the greeting, if the line is GREETING. Returns the state.
bridge_line_state_t bridge_line_greet(bridge_line_t *self, uint64_t now_us);

/// Sends one request of a HERE line. IWC_FULL: BRIDGE_LINE_MAX requests have no reply, or the gateway does not read; nothing is kept.
iwc_result_t bridge_line_send(bridge_line_t *self, const char *request, const bridge_sent_t *sent);

/// The next event of a HERE line in `*out_event`; replies on the way to it are passed to their `answer`. False: there is no event now; the
/// line may be AWAY afterwards.
bool bridge_line_next(bridge_line_t *self, iwc_message_t *out_event);

/// Answers with NULL what is due, and returns how many there were.
unsigned bridge_line_expire(bridge_line_t *self, uint64_t now_us);

/// The replies for this context are not needed any more.
void bridge_line_forget(bridge_line_t *self, const void *context);

/// When `greet` or `expire` has something to do, if no byte comes.
uint64_t bridge_line_next_us(const bridge_line_t *self, uint64_t now_us);

/// Requests without reply.
unsigned bridge_line_in_flight(const bridge_line_t *self);

#endif
