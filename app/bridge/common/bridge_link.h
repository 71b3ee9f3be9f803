// SPDX-License-Identifier: MIT
/// Connection of a bridge to the gateway: its subscription, its questions, and the path of its stops.
///
///     STARTING --no gateway--> AWAY --subscribed--> HERE --lost--> AWAY, tried again after 0.1 s to 2 s
///        '--------------subscribed-----------------^
///
/// The log reports an absent gateway once, when the link becomes AWAY. Connection and greeting are states of the line
/// (bridge_line.h).
///
/// Questions use the connection that watches: at most BRIDGE_LINE_MAX of them have no reply, the others wait here in
/// their order. Stops use a separate connection (bridge_stop.h) and never wait for a question. No call waits. No
/// question is sent twice.
#ifndef BRIDGE_LINK_H
#define BRIDGE_LINK_H

#include "bridge_stop.h"

/// A question without a reply after this time is answered with NULL, even if it was not sent yet.
#define BRIDGE_ANSWER_US 1000000U
/// Largest number of questions that wait to be sent.
#define BRIDGE_ASKED_MAX 64U

/// Callbacks. They are called from `bridge_link_step` and `bridge_link_ask`.
typedef struct {
    void *context;
    void (*here)(void *context, uint64_t now_us);
    void (*gone)(void *context, uint64_t now_us);
    void (*event)(void *context, const iwc_message_t *event, uint64_t now_us);
} bridge_listener_t;

typedef struct {
    const char *program; ///< Name of the program in the log.
    const char *socket;
    unsigned rate_hz; ///< Rate of the event `state`.
    bool drives;      ///< The bridge needs the right to drive.
    bool latest;      ///< The bridge may skip an event if a newer one is available.
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
    bridge_line_t line; ///< Line that watches.
    bridge_stop_t stop;
    int epoll_fd;
    bridge_link_state_t state;
    uint64_t try_us;    ///< Time of the next connection.
    uint64_t wait_us;   ///< Delay between two tries.
    uint64_t denied_us; ///< Time since which the socket denies access; 0: it permits access.
    uint64_t connections;
    uint64_t random;
    uint64_t now_us;                           ///< Time of the call in progress.
    bridge_question_t waits[BRIDGE_ASKED_MAX]; ///< Oldest first.
    unsigned count;
    bool has_clock;       ///< An event of this connection had a time.
    int64_t ahead_us;     ///< Largest difference between the time of an event and of its arrival ...
    uint64_t ahead_at_us; ///< ... and the time at which it was found.
} bridge_link_t;

/// Returns false if there is no memory. The texts of `terms` must outlive the link. The link must not be moved.
bool bridge_link_open(bridge_link_t *self, const bridge_link_terms_t *terms, const bridge_listener_t *listener);
void bridge_link_close(bridge_link_t *self);

/// Connects, reads, sends waiting requests, and drops requests whose reply is overdue. Returns 0, or 77 with a line on
/// stderr if rights are missing.
int bridge_link_step(bridge_link_t *self, uint64_t now_us);

/// Returns the time of the next work of `step` without input.
uint64_t bridge_link_next_us(const bridge_link_t *self, uint64_t now_us);

/// Returns how far the gateway's clock is ahead of CLOCK_MONOTONIC of this process, in microseconds. A gateway on a board
/// has a clock of its own; a gateway on this machine uses the same one, and the result is 0. Otherwise it is never too
/// large. It is too small by the time on the way of the fastest event of this connection, and falls by 200 ppm until the
/// next such event, because clocks drift. 0 before the first event.
int64_t bridge_link_ahead_us(const bridge_link_t *self, uint64_t now_us);

/// Changes the rate of the event `state`. If the gateway cannot be asked now, nothing changes: call it again.
void bridge_link_rate(bridge_link_t *self, unsigned rate_hz, uint64_t now_us);

/// Returns the descriptor for poll(): readable when `step` has work. It covers all connections to the gateway,
/// including those of lease.h.
int bridge_link_fd(const bridge_link_t *self);

/// Asks a question; the request begins with `{"cmd":"`. `answer` (NULL: the reply is not needed) is called once later,
/// unless `context` is forgotten before. `stop` and `estop` use their own path. Returns false if it cannot be asked;
/// `answer` is then not called.
bool bridge_link_ask(bridge_link_t *self, const char *request, bridge_answer_t answer, void *context, uint64_t now_us);

/// Discards the answers for this context. A waiting question is not sent; a stop is still sent.
void bridge_link_forget(bridge_link_t *self, const void *context);

#endif
