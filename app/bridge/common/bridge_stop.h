// SPDX-License-Identifier: MIT
/// The path of the stops of a bridge: a separate connection to the gateway that carries only `stop` and `estop`.
///
/// The connection is opened at the start and again after each loss. Any number of people may ask. A request that is not
/// sent yet serves all who ask for the same, so that the gateway reads at most two lines before the newest stop. A stop
/// that is already sent serves no new asker, because the wheels may have been armed since.
#ifndef BRIDGE_STOP_H
#define BRIDGE_STOP_H

#include "bridge_line.h"

/// After this time without a reply a stop counts as not delivered. The connection is dropped and made again.
#define BRIDGE_STOP_US 400000U
/// Largest number of people who wait for a reply.
#define BRIDGE_STOPS_MAX 1024U

typedef enum { BRIDGE_STOP, BRIDGE_ESTOP, BRIDGE_STOP_KINDS } bridge_stop_kind_t;

typedef struct {
    enum { BRIDGE_STOP_FREE, BRIDGE_STOP_WAITS, BRIDGE_STOP_SENT } state;
    bridge_stop_kind_t kind;
    uint64_t until_us;
    bridge_answer_t answer;
    void *context;
} bridge_stop_asker_t;

typedef struct bridge_stop bridge_stop_t;

/// Context of `bridge_line_send`: the kind that was sent.
typedef struct {
    bridge_stop_t *stop;
    bridge_stop_kind_t kind;
} bridge_stop_tag_t;

struct bridge_stop {
    bridge_line_t line;
    uint64_t try_us;  ///< Time of the next connection without a request.
    uint64_t wait_us; ///< Delay between two tries.
    uint64_t random;
    uint64_t since_us;                           ///< Time at which the line came up.
    bool in_flight[BRIDGE_STOP_KINDS];           ///< Sent without a reply; a new request may come before it.
    uint64_t wanted_until_us[BRIDGE_STOP_KINDS]; ///< Deadline of a request that is not sent yet; 0: none.
    char request[BRIDGE_STOP_KINDS][BRIDGE_REQUEST_SIZE];
    bridge_stop_tag_t tag[BRIDGE_STOP_KINDS];
    bridge_stop_asker_t askers[BRIDGE_STOPS_MAX];
};

/// Returns false if there is no memory. `socket` must outlive it; `epoll_fd` watches its descriptor. It must not be
/// moved.
bool bridge_stop_open(bridge_stop_t *self, const char *socket, int epoll_fd);
void bridge_stop_close(bridge_stop_t *self);

/// Connects, sends, reads, and drops requests whose reply is overdue.
void bridge_stop_step(bridge_stop_t *self, uint64_t now_us);
uint64_t bridge_stop_next_us(const bridge_stop_t *self, uint64_t now_us);

/// Asks for a `stop` or an `estop`. `answer` (NULL: not needed) is called once, within BRIDGE_STOP_US. Returns false if
/// there is no gateway; `answer` is then not called.
bool bridge_stop_ask(bridge_stop_t *self, const char *request, bridge_answer_t answer, void *context, uint64_t now_us);

/// Discards the answers for this context. The stop is still delivered.
void bridge_stop_forget(bridge_stop_t *self, const void *context);

bool bridge_is_stop(const char *request);

/// Doubles `*wait_us`, up to `longest_us`. Returns now plus a random time in the upper half of it, so that many bridges
/// do not connect at the same time. `*random` is the state, which differs in each process.
uint64_t bridge_backoff_us(uint64_t *wait_us, uint64_t longest_us, uint64_t *random, uint64_t now_us);

#endif
