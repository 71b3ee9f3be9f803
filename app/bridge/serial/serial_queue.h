// SPDX-License-Identifier: MIT
/// What one client has asked and not been told yet: in order, bounded, and never executed late.
///
///     WAITING --next--> SENT --answer--> HELD ---------.
///        |                 '--no answer in time--> ANSWERED --oldest of all: told--> gone
///        '--replaced, overtaken by a stop, too old--> ANSWERED
///
/// - One request of a client is on the wire at a time. A `drive` that waits is replaced by a newer one: there is never more than
///   one that is unanswered and one that waits; one whose answer takes longer than `hold_us` holds nobody back any more, for
///   it may be lost.
/// - A stop goes at once, behind what cannot move anything; what waits before it and could is refused.
/// - A `drive` that waited for SERIAL_FRESH_US is refused here. What is on the wire is judged by the board, by what it quotes.
/// - A stop that is not answered is sent again, with the same number; nothing else is.
///
/// Pure: time is an argument. Answers leave in the order of the requests: one that comes early is held.
#ifndef SERIAL_QUEUE_H
#define SERIAL_QUEUE_H

#include "iwheel_northbound/line.h"
#include "iwheel_northbound/request.h"

/// Requests of one client that are under way; the next one stays in its socket.
#define SERIAL_QUEUE_SIZE 4U
/// A command to move that waited so long here is not sent any more: half a lease.
#define SERIAL_FRESH_US 100000U
/// The same of what a motion may follow, and of a stop that found no room.
#define SERIAL_GRANT_US 1000000U
/// A stop is sent again after so long.
#define SERIAL_AGAIN_US 150000U
/// The board has lost a request, or we its answer: `arm` may take `echo_ms`.
#define SERIAL_PATIENCE_US      3000000U
#define SERIAL_MOVE_PATIENCE_US 1000000U ///< The same of a `drive`.
/// Room for a request as it goes over the wire, without channel and CRC.
#define SERIAL_JSON_MAX (IWN_LINE_BOARD_MAX - 2U - IWN_LINE_SUFFIX)

/// What a request can do, for whoever must decide whether it may wait.
typedef enum {
    SERIAL_ASKS = 0, ///< It moves nothing and makes nothing possible.
    SERIAL_GRANTS,   ///< arm, reset and the like: a motion may follow.
    SERIAL_MOVES,    ///< drive and twist.
    SERIAL_STOPS,    ///< stop, disarm and estop.
} serial_kind_t;

/// ANSWERED: refused by us; HELD: answered by the board.
typedef enum { SERIAL_WAITING = 0, SERIAL_SENT, SERIAL_HELD, SERIAL_ANSWERED } serial_state_t;

typedef struct {
    serial_state_t state;
    serial_kind_t kind;
    uint64_t number;   ///< Its id on the wire; rises.
    uint64_t came_us;  ///< When its client sent it, as far as can be told.
    uint64_t sent_us;  ///< When it went to the wire first.
    uint64_t tried_us; ///< And last.
    iwn_id_t id;       ///< The client's own.
    iw_client_t guest; ///< Who has asked, if not the client of this channel: a stop beyond the maximum; IW_CLIENT_NONE.
    iwn_error_t error; ///< ANSWERED: why not,
    const char *reason; ///< and in words.
    bool ok;            ///< HELD: whether the board said yes; the rest of its answer is in `json`.
    size_t length;      ///< Of `json`.
    char json[SERIAL_JSON_MAX];
} serial_request_t;

typedef struct {
    serial_request_t ring[SERIAL_QUEUE_SIZE];
    unsigned first;
    unsigned count;
    unsigned unanswered; ///< Requests in a row that the board did not answer.
    uint64_t hold_us;    ///< So long the answer to a `drive` may take, by the speed of the wire.
} serial_queue_t;

serial_kind_t serial_kind_of(iwn_cmd_t cmd);

void serial_queue_init(serial_queue_t *self, uint64_t hold_us);
bool serial_queue_is_full(const serial_queue_t *self);

/// The place of a new request, to be filled in by the caller, who then calls serial_queue_put. Not when it is full.
serial_request_t *serial_queue_place(serial_queue_t *self);
/// Takes what stands in that place: WAITING, or ANSWERED.
void serial_queue_put(serial_queue_t *self);

/// What has waited too long is ANSWERED.
void serial_queue_age(serial_queue_t *self, uint64_t now_us);
/// When there is something to do by the time alone; UINT64_MAX: never.
uint64_t serial_queue_next_us(const serial_queue_t *self, uint64_t now_us);

/// What goes to the wire now, or NULL. `stops_only` leaves the others. The caller sends it and calls serial_queue_sent.
serial_request_t *serial_queue_next(serial_queue_t *self, bool stops_only, uint64_t now_us);
void serial_queue_sent(serial_request_t *request, uint64_t now_us);

/// The oldest, if it is ANSWERED or HELD: the caller tells its client and drops it.
const serial_request_t *serial_queue_answered(const serial_queue_t *self);
void serial_queue_drop(serial_queue_t *self);

/// The board has answered the request with this number: `rest` is what its client is told behind `ok`. False: nobody waits for it any
/// more. True: if it is the oldest, it is the caller's to tell and drop; else it is HELD.
bool serial_queue_take(serial_queue_t *self, uint64_t number, bool ok, const char *rest, size_t length);

#endif
