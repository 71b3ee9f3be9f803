// SPDX-License-Identifier: MIT
/// The path of a bridge's stops: a connection of its own to the gateway, which carries nothing but `stop` and `estop`.
///
/// It is opened at the start and again after each loss. Any number of people may ask: a request that is not sent yet carries all who ask
/// for the same, so that the gateway reads at most two lines before the newest stop. A stop that is sent already carries nobody new:
/// the wheels may have been armed since.
#ifndef BRIDGE_STOP_H
#define BRIDGE_STOP_H

#include "bridge_line.h"

/// A stop that has no reply by then was not delivered. The connection is dropped and made again.
#define BRIDGE_STOP_US 400000U
/// People who wait for the reply at one time.
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

/// What `bridge_line_send` gets as its context: which of the two kinds was sent.
typedef struct {
    bridge_stop_t *stop;
    bridge_stop_kind_t kind;
} bridge_stop_tag_t;

struct bridge_stop {
    bridge_line_t line;
    uint64_t try_us;  ///< When to connect next, if no request comes.
    uint64_t wait_us; ///< Between two tries.
    uint64_t random;
    uint64_t since_us;                 ///< When the line came up last.
    bool in_flight[BRIDGE_STOP_KINDS]; ///< Independent of the next line: a new one may be wanted before the reply.
    uint64_t wanted_until_us[BRIDGE_STOP_KINDS]; ///< Asked for and not sent yet; 0: no.
    char request[BRIDGE_STOP_KINDS][BRIDGE_REQUEST_SIZE];
    bridge_stop_tag_t tag[BRIDGE_STOP_KINDS];
    bridge_stop_asker_t askers[BRIDGE_STOPS_MAX];
};

/// False: no memory. `socket` outlives it; `epoll_fd` watches its descriptor. It must not be moved afterwards.
bool bridge_stop_open(bridge_stop_t *self, const char *socket, int epoll_fd);
void bridge_stop_close(bridge_stop_t *self);

/// Connects, sends, reads, and gives up what was not answered.
void bridge_stop_step(bridge_stop_t *self, uint64_t now_us);
uint64_t bridge_stop_next_us(const bridge_stop_t *self, uint64_t now_us);

/// `request` is a `stop` or an `estop`. `answer` (NULL: not needed) is called once, within BRIDGE_STOP_US. False: there is no gateway, and
/// `answer` is not called.
bool bridge_stop_ask(bridge_stop_t *self, const char *request, bridge_answer_t answer, void *context, uint64_t now_us);

/// The answers for this context are not needed any more; the stop itself is still delivered.
void bridge_stop_forget(bridge_stop_t *self, const void *context);

bool bridge_is_stop(const char *request);

/// Twice as long as `wait_us`, at most `longest_us`, into `*wait_us`; returns a time in its upper half from now. Many bridges do not come
/// at the same time so. `*random` is its state, different in each process.
uint64_t bridge_backoff_us(uint64_t *wait_us, uint64_t longest_us, uint64_t *random, uint64_t now_us);

#endif
