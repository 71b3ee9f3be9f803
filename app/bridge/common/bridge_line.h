// SPDX-License-Identifier: MIT
/// One connection of a bridge to the gateway, and the requests on it that have no reply yet. No call waits.
///
///       +--------connect_for_stop----------+
///       |                                  v
///     AWAY --connect--> GREETING --hello--> HERE
///       ^                  |                 |
///       +--- refused, no hello, closed, drop-+
///
/// The owner decides when to connect again. One thread.
#ifndef BRIDGE_LINE_H
#define BRIDGE_LINE_H

#include "iwheel_client/client.h"

/// Largest number of requests without a reply on one line: the gateway reads this number from a watcher at a time.
#define BRIDGE_LINE_MAX 4U
/// The line is dropped if the greeting of the gateway does not arrive within this time.
#define BRIDGE_GREETING_US 500000U
/// Size of the longest request of a bridge with its terminator.
#define BRIDGE_REQUEST_SIZE 1200U

/// Receives the reply of the gateway; NULL if there was none in time. The reply is valid during the call.
typedef void (*bridge_answer_t)(void *context, const iwc_message_t *reply);

typedef enum { BRIDGE_AWAY, BRIDGE_GREETING, BRIDGE_HERE } bridge_line_state_t;

/// A sent request without a reply.
typedef struct {
    int64_t id; ///< Id of the request; 0: this place is free.
    uint64_t until_us;
    bridge_answer_t answer; ///< NULL: the reply is not needed.
    void *context;
} bridge_sent_t;

typedef struct {
    const char *socket; ///< Must outlive the line.
    int epoll_fd;       ///< Watches the descriptor; belongs to the owner.
    iwc_t *gateway;
    bridge_line_state_t state;
    iwc_result_t result; ///< Reason why the line is AWAY.
    int greeting_fd;     ///< GREETING: the connected descriptor.
    uint64_t greeting_until_us;
    bridge_sent_t sent[BRIDGE_LINE_MAX];
} bridge_line_t;

/// Initializes a line without a connection. Returns false if there is no memory.
bool bridge_line_open(bridge_line_t *self, const char *socket, int epoll_fd);
void bridge_line_close(bridge_line_t *self);

/// Begins to connect an AWAY line. Returns false and sets `result` if the socket accepts no connection now.
bool bridge_line_connect(bridge_line_t *self, uint64_t now_us);

/// The same for a line that carries stops only, which waits for no greeting: the line is then HERE. The gateway sends no
/// greeting in the places that it keeps for stops. It closes a connection there after 200 ms without a stop.
bool bridge_line_connect_for_stop(bridge_line_t *self);

/// Drops the connection, and answers each request without a reply with NULL.
void bridge_line_drop(bridge_line_t *self, iwc_result_t why);

/// Reads the greeting, if the line is GREETING. Returns the state.
bridge_line_state_t bridge_line_greet(bridge_line_t *self, uint64_t now_us);

/// Sends one request on a HERE line. Returns IWC_FULL and stores nothing if BRIDGE_LINE_MAX requests have no reply, or
/// if the gateway does not read.
iwc_result_t bridge_line_send(bridge_line_t *self, const char *request, const bridge_sent_t *sent);

/// Writes the next event of a HERE line to `*out_event`; replies before it are passed to their `answer`. Returns false
/// if there is no event now; the line may then be AWAY.
bool bridge_line_next(bridge_line_t *self, iwc_message_t *out_event);

/// Answers requests that are due with NULL. Returns their number.
unsigned bridge_line_expire(bridge_line_t *self, uint64_t now_us);

/// Discards the answers for this context. Their requests still count as sent.
void bridge_line_forget(bridge_line_t *self, const void *context);

/// Returns the time of the next work of `greet` or `expire` without input.
uint64_t bridge_line_next_us(const bridge_line_t *self, uint64_t now_us);

/// Returns the number of requests without a reply.
unsigned bridge_line_in_flight(const bridge_line_t *self);

#endif
