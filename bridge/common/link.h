// SPDX-License-Identifier: MIT
/// A bridge's one connection to the gateway: kept up for ever, asked without waiting, and listened to.
///
///     AWAY --found--> HERE --lost--> AWAY, tried again after 0.1 s to 2 s
///
/// Nothing waits but the making of a connection, twice BRIDGE_GREETING_MS at most. Nothing is asked twice.
#ifndef IW_BRIDGE_LINK_H
#define IW_BRIDGE_LINK_H

#include "iwheel_client/client.h"

#define BRIDGE_GREETING_MS 200
/// After this an answer does not count any more.
#define BRIDGE_ANSWER_US 1000000U
/// A stop that is not answered by then was not delivered, and the connection is closed, which stops the wheels if the lease was ours.
#define BRIDGE_STOP_US   400000U
#define BRIDGE_ASKED_MAX 64U

/// The gateway's reply; NULL: there was none in time. Valid during the call.
typedef void (*bridge_answer_t)(void *context, const iwc_message_t *reply);

/// What the bridge is told. All are called from `bridge_link_step` and `bridge_link_ask`.
typedef struct {
    void *context;
    void (*here)(void *context, uint64_t now_us);
    void (*gone)(void *context, uint64_t now_us);
    void (*event)(void *context, const iwc_message_t *event, uint64_t now_us);
} bridge_listener_t;

typedef struct {
    int64_t id; ///< 0: this place is free.
    uint64_t until_us;
    bool is_stop;
    bridge_answer_t answer;
    void *context;
} bridge_question_t;

typedef struct {
    const char *program; ///< Its name, for the log.
    const char *socket;
    unsigned rate_hz; ///< Of the event `state`.
    bool drives;      ///< It must have the right to drive.
    bool latest;      ///< It may miss an event of which a newer one is there.
} bridge_link_terms_t;

typedef struct {
    bridge_link_terms_t terms;
    bridge_listener_t listener;
    iwc_t *gateway;
    bool is_here;
    bool told_away;     ///< That it is not here.
    uint64_t try_us;    ///< When to connect next.
    uint64_t wait_us;   ///< Between two tries.
    uint64_t denied_us; ///< Since when the socket may not be used; 0: it may.
    uint64_t connections;
    uint64_t random;
    bridge_question_t asked[BRIDGE_ASKED_MAX];
} bridge_link_t;

/// False: no memory. The texts of `terms` must outlive the link.
bool bridge_link_open(bridge_link_t *self, const bridge_link_terms_t *terms, const bridge_listener_t *listener);
void bridge_link_close(bridge_link_t *self);

/// Connects, reads, and gives up what was not answered. 0; or 77: the rights are missing, with a line on stderr.
int bridge_link_step(bridge_link_t *self, uint64_t now_us);

/// When `step` has something to do, whatever comes.
uint64_t bridge_link_next_us(const bridge_link_t *self, uint64_t now_us);

/// For poll(); -1: nothing to wait for.
int bridge_link_fd(const bridge_link_t *self);

/// Asks, with a request that begins with `{"cmd":"`; `answer` (NULL: nobody wants it) is called later, once, unless `context` is forgotten before. False: it could not be asked.
bool bridge_link_ask(bridge_link_t *self, const char *request, bridge_answer_t answer, void *context, uint64_t now_us);

/// Nobody wants the answers for this context any more.
void bridge_link_forget(bridge_link_t *self, const void *context);

/// Twice as long as `wait_us`, at most `longest_us`, into `*wait_us`; returned: a moment in its upper half from now. Many bridges do not
/// come at once so. `*random` is the state of its chance, anything but all alike.
uint64_t bridge_backoff_us(uint64_t *wait_us, uint64_t longest_us, uint64_t *random, uint64_t now_us);

#endif
