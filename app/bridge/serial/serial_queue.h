// SPDX-License-Identifier: MIT
/// Queue of the requests of one client that have no reply yet: ordered, bounded, and never executed late.
///
///     WAITING --next--> SENT --answer--> HELD ---------.
///        |                 '--no answer in time--> ANSWERED --oldest of all: sent--> gone
///        '--replaced, overtaken by a stop, too old--> ANSWERED
///     stop: SENT from the beginning (relay.h sends and repeats it)
///
/// - One request of a client is on the line at a time. A newer `drive` replaces one that waits, so that there is at
///   most one without answer and one that waits. A `drive` whose answer takes longer than `hold_us` delays no other
///   request, because its answer may be lost. The answer to a later request proves that, and frees its place.
/// - A stop is not sent from here, and waits for no request: its place in the queue is that of its reply. Waiting
///   requests before it that could move are refused, in the queues of all clients.
/// - A `drive` that waited for SERIAL_FRESH_US is refused here. The board judges a request on the line by its quote.
/// - No request is repeated.
///
/// Pure state machine: time is an argument. Replies are sent in the order of the requests; an early one is held.
#ifndef SERIAL_QUEUE_H
#define SERIAL_QUEUE_H

#include "iwheel_northbound/line.h"
#include "iwheel_northbound/request.h"

/// Number of requests of a client in progress. The next one stays in its socket.
#define SERIAL_QUEUE_SIZE 4U
/// A command to move that waited for this time is no longer sent: half a lease.
#define SERIAL_FRESH_US 100000U
/// The same for requests that permit motion.
#define SERIAL_GRANT_US 1000000U
/// A request that waited for this time carries the time at which it was sent, if it has a field for that: the board
/// refuses it if a stop came in the meantime, also one that the relay does not know, such as a press of the e-stop.
#define SERIAL_DATED_US 50000U
/// After this time the board has lost a request, or the relay its answer: `arm` may need `echo_ms`.
#define SERIAL_PATIENCE_US      3000000U
#define SERIAL_MOVE_PATIENCE_US 1000000U ///< The same for a `drive`.
/// Reply to a request from before a stop.
#define SERIAL_OVERTAKEN                                                                                               \
    "the wheels were stopped before this request was sent to the board; see why (iwheelctl why), then send it again"
/// Reply to a request that the board did not answer.
#define SERIAL_NO_REPLY "the board did not answer: this request or its reply was lost on the serial line; send it again"
/// Space for that time in the request.
#define SERIAL_DATE_MAX 32U
/// Size of a request on the line, without channel and CRC.
#define SERIAL_JSON_MAX (IWN_LINE_BOARD_MAX - 2U - IWN_LINE_SUFFIX)

/// Effect of a request, which decides whether it may wait.
typedef enum {
    SERIAL_ASKS = 0, ///< It moves nothing and permits nothing.
    SERIAL_GRANTS,   ///< arm, reset and similar: a motion may follow.
    SERIAL_MOVES,    ///< drive and twist.
    SERIAL_STOPS,    ///< stop, disarm and estop.
} serial_kind_t;

/// ANSWERED: refused by the relay. HELD: answered by the board.
typedef enum { SERIAL_WAITING = 0, SERIAL_SENT, SERIAL_HELD, SERIAL_ANSWERED } serial_state_t;

typedef struct {
    serial_state_t state;
    serial_kind_t kind;
    uint64_t number;    ///< Id on the line; increases.
    uint64_t came_us;   ///< Time at which its client sent it, as far as known.
    uint64_t sent_us;   ///< Time of the first transmission.
    uint64_t tried_us;  ///< Time of the last transmission.
    iwn_id_t id;        ///< Id of the client.
    iwn_error_t error;  ///< ANSWERED, and a stop whose line is refused: the error, ...
    const char *reason; ///< ... and its text.
    bool undated;       ///< GRANTS: it has no `t_us`, and its command permits one.
    bool ok;            ///< HELD: whether the board accepted it. The rest of the answer is in `json`.
    size_t length;      ///< Length of `json`.
    char json[SERIAL_JSON_MAX];
} serial_request_t;

typedef struct {
    serial_request_t ring[SERIAL_QUEUE_SIZE];
    unsigned first;
    unsigned count;
    unsigned unanswered; ///< Number of requests in a row without an answer.
    uint64_t hold_us;    ///< Longest time of an answer to a `drive`, by the rate of the line.
} serial_queue_t;

serial_kind_t serial_kind_of(iwn_cmd_t cmd);
/// Returns true for the requests that the board judges by their `t_us`.
bool serial_has_age(iwn_cmd_t cmd);

void serial_queue_init(serial_queue_t *self, uint64_t hold_us);
bool serial_queue_is_full(const serial_queue_t *self);

/// Returns the place of a new request, which the caller fills; then it calls serial_queue_put. Not if the queue is
/// full.
serial_request_t *serial_queue_place(serial_queue_t *self);
/// Adds the request in that place: WAITING, or ANSWERED, or a stop in any state.
void serial_queue_put(serial_queue_t *self);
/// Refuses waiting requests that could move the wheels, or that could later be mistaken for such a request, before a
/// newer request of this kind.
void serial_queue_overtake(serial_queue_t *self, serial_kind_t newer);

/// Changes requests that have waited too long to ANSWERED.
void serial_queue_age(serial_queue_t *self, uint64_t now_us);
/// Returns the time of the next change without input; UINT64_MAX if there is none.
uint64_t serial_queue_next_us(const serial_queue_t *self, uint64_t now_us);

/// Returns the request to send now, or NULL. The caller sends it and calls serial_queue_sent.
serial_request_t *serial_queue_next(serial_queue_t *self, uint64_t now_us);
void serial_queue_sent(serial_request_t *request, uint64_t now_us);

/// Returns the oldest request if it is ANSWERED or HELD. The caller replies to its client and drops it.
const serial_request_t *serial_queue_answered(const serial_queue_t *self);
void serial_queue_drop(serial_queue_t *self);

/// Records the board's answer to the request with this number: `rest` is the part after `ok` for its client. Returns
/// false if no request waits for it. If the request is the oldest, the caller replies and drops it; otherwise it is
/// HELD.
bool serial_queue_take(serial_queue_t *self, uint64_t number, bool ok, const char *rest, size_t length);

/// Stores the part of an answer after `ok`: HELD.
void serial_request_hold(serial_request_t *request, const char *rest, size_t length);

#endif
