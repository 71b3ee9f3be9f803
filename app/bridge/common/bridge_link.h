// SPDX-License-Identifier: MIT
/// A bridge's side towards the gateway: what it watches, what it asks, and the path of its stops.
///
///     STARTING --no gateway--> AWAY --subscribed--> HERE --lost--> AWAY, tried again after 0.1 s to 2 s
///        '--------------subscribed-----------------^
///
/// The log reports an absent gateway once, when the link becomes AWAY. Connection and greeting are states of the line (bridge_line.h).
///
/// Questions go over the connection that watches: at most BRIDGE_LINE_MAX of them have no reply, the others wait here in their order.
/// Stops go over a connection of their own (bridge_stop.h) and never behind a question. No call waits. No question is sent twice.
#ifndef BRIDGE_LINK_H
#define BRIDGE_LINK_H

#include "bridge_stop.h"

/// A question without reply after this time is answered with NULL, also if it was not sent yet.
#define BRIDGE_ANSWER_US 1000000U
/// Questions that wait or are on their way.
#define BRIDGE_ASKED_MAX 64U

/// All are called from `bridge_link_step` and `bridge_link_ask`.
typedef struct {
    void *context;
    void (*here)(void *context, uint64_t now_us);
    void (*gone)(void *context, uint64_t now_us);
    void (*event)(void *context, const iwc_message_t *event, uint64_t now_us);
} bridge_listener_t;

typedef struct {
    const char *program; ///< Its name, for the log.
    const char *socket;
    unsigned rate_hz; ///< Of the event `state`.
    bool drives;      ///< It must have the right to drive.
    bool latest;      ///< It may miss an event of which a newer one is there.
} bridge_link_terms_t;

/// A question that is not sent yet.
typedef struct {
    char request[BRIDGE_REQUEST_SIZE];
    uint64_t until_us;
    bridge_answer_t answer;
    void *context;
} bridge_question_t;

typedef enum { BRIDGE_LINK_STARTING, BRIDGE_LINK_AWAY, BRIDGE_LINK_HERE } bridge_link_state_t;

typedef struct {
    bridge_link_terms_t terms;
    bridge_listener_t listener;
    bridge_line_t line; ///< That watches.
    bridge_stop_t stop;
    int epoll_fd;
    bridge_link_state_t state;
    uint64_t try_us;    ///< When to connect next.
    uint64_t wait_us;   ///< Between two tries.
    uint64_t denied_us; ///< Since when the socket may not be used; 0: it may.
    uint64_t connections;
    uint64_t random;
    uint64_t now_us;                           ///< Of the call that is being carried out.
    bridge_question_t waits[BRIDGE_ASKED_MAX]; ///< The oldest first.
    unsigned count;
} bridge_link_t;

/// False: no memory. The texts of `terms` must outlive the link, which must not be moved.
bool bridge_link_open(bridge_link_t *self, const bridge_link_terms_t *terms, const bridge_listener_t *listener);
void bridge_link_close(bridge_link_t *self);

/// Connects, reads, sends what waits, and gives up what was not answered. 0; or 77: the rights are missing, with a line on stderr.
int bridge_link_step(bridge_link_t *self, uint64_t now_us);

/// When `step` has something to do, if no byte comes.
uint64_t bridge_link_next_us(const bridge_link_t *self, uint64_t now_us);

/// Changes the rate of the event `state`. If the gateway cannot be asked now, nothing changes: call it again.
void bridge_link_rate(bridge_link_t *self, unsigned rate_hz, uint64_t now_us);

/// For poll(): readable when `step` has something to do. It stands for all connections to the gateway, those of lease.h too.
int bridge_link_fd(const bridge_link_t *self);

/// Asks, with a request that begins with `{"cmd":"`; `answer` (NULL: the reply is not needed) is called later, once, unless `context` is
/// forgotten before. `stop` and `estop` take their own path. False: it could not be asked, and `answer` is not called.
bool bridge_link_ask(bridge_link_t *self, const char *request, bridge_answer_t answer, void *context, uint64_t now_us);

/// The answers for this context are not needed any more. A question that waits is not sent; a stop is.
void bridge_link_forget(bridge_link_t *self, const void *context);

#endif
