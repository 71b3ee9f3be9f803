// SPDX-License-Identifier: MIT
/// The drive connections of a bridge: one per person, and the key that gives that person the right to drive.
///
///     FREE --arm--> ASKING --granted--> HELD --end--> ENDING --0.4 s, or needed again--> FREE
///                     |                   |
///                     +---- refused ------+---- closed, not_holder ----> FREE
///
/// There are two places: the holder's and that of a person who asks. No other person has a drive connection. The gateway decides who holds
/// the lease: to it two people are two clients, so the second gets `busy` with the name of the first, and `takeover` moves the lease at
/// standstill only. Names are labels for messages; the key is the right, and it goes only to the person who armed.
#ifndef BRIDGE_LEASE_H
#define BRIDGE_LEASE_H

#include "bridge_line.h"
#include "secret.h"

/// Longest name of a person with its terminator.
#define BRIDGE_NAME_SIZE 65U
/// The gateway answers an arm within this time (it proves an echo first).
#define BRIDGE_ARM_US 1000000U
/// A drive command without reply after this time is answered with NULL.
#define BRIDGE_DRIVE_US 1000000U
/// The connection of a holder whose lease ends lasts so much longer, so that the stop reaches the gateway before its end does.
#define BRIDGE_ENDING_US 400000U

typedef enum {
    BRIDGE_LEASE_OK,    ///< On its way; the answer follows.
    BRIDGE_LEASE_BUSY,  ///< Another person is asking.
    BRIDGE_LEASE_AWAY,  ///< There is no gateway.
    BRIDGE_LEASE_WRONG, ///< No key, or not the holder's.
    BRIDGE_LEASE_FULL   ///< The gateway does not answer: the command is dropped.
} bridge_lease_result_t;

typedef enum { BRIDGE_FREE, BRIDGE_ASKING, BRIDGE_HELD, BRIDGE_ENDING } bridge_place_state_t;

typedef struct bridge_lease bridge_lease_t;
typedef struct bridge_place bridge_place_t;

/// Who gets the answer. `answer` NULL: it is not needed.
typedef struct {
    bridge_answer_t answer;
    void *context;
} bridge_asker_t;

/// A drive command without reply.
typedef struct {
    bridge_place_t *place; ///< NULL: free.
    bridge_asker_t asker;
} bridge_driven_t;

struct bridge_place {
    bridge_lease_t *lease;
    bridge_place_state_t state;
    bridge_line_t line;
    char name[BRIDGE_NAME_SIZE];
    char key[BRIDGE_SECRET_SIZE];
    bool key_is_gateways;              ///< The gateway knows it, and wants it in each drive.
    char request[BRIDGE_REQUEST_SIZE]; ///< ASKING: the arm, until it is sent; then empty.
    bridge_asker_t asker;              ///< ASKING: for the reply to arm.
    uint64_t until_us;                 ///< ASKING, ENDING: its end.
    bridge_driven_t driven[BRIDGE_LINE_MAX];
};

struct bridge_lease {
    bridge_place_t place[2];
    bridge_place_t *holder; ///< NULL: no person holds the lease through this bridge.
};

/// False: no memory. `socket` outlives it; `epoll_fd` is that of the link. It must not be moved afterwards.
bool bridge_lease_open(bridge_lease_t *self, const char *socket, int epoll_fd);
void bridge_lease_close(bridge_lease_t *self);

/// Connects, reads, and gives up what was not answered.
void bridge_lease_step(bridge_lease_t *self, uint64_t now_us);
uint64_t bridge_lease_next_us(const bridge_lease_t *self, uint64_t now_us);

/// A person, called `name`, asks for the lease with this `arm` request. BRIDGE_LEASE_OK: the answer is called later, once. If the reply
/// grants it, `bridge_lease_key` is the person's key from then on, during the call already.
bridge_lease_result_t bridge_lease_arm(bridge_lease_t *self, const char *name, const char *request,
                                       bridge_asker_t asker, uint64_t now_us);

/// The holder's key; NULL: no person holds the lease through this bridge.
const char *bridge_lease_key(const bridge_lease_t *self);
/// The holder's name; NULL: no person holds it.
const char *bridge_lease_name(const bridge_lease_t *self);
/// True if `key` is the holder's. NULL is no key.
bool bridge_lease_is_holder(const bridge_lease_t *self, const char *key);

/// One `drive` or `twist` of the person who has `key`, once. BRIDGE_LEASE_OK: the answer is called later. A reply
/// `not_holder` ends the lease.
bridge_lease_result_t bridge_lease_drive(bridge_lease_t *self, const char *key, const char *request,
                                         bridge_asker_t asker, uint64_t now_us);

/// The lease of this bridge ends: after a stop was asked for, or an event said so, or the person is gone. From now on no key is the
/// right one, and who was asking is answered with NULL. It sends nothing: the caller sends the stop.
void bridge_lease_end(bridge_lease_t *self, uint64_t now_us);

/// The answers for this context are not needed any more. Who was asking for the lease under it does not get it.
void bridge_lease_forget(bridge_lease_t *self, const void *context);

// ---- deflected sticks -----------------------------------------------------------------------------------------------

/// Sources whose last nonzero command is noted.
#define BRIDGE_MOVERS_MAX 16U
/// After the last nonzero command of a source, arm and reset are refused for so long, or for the lease if that is longer.
#define BRIDGE_MOVER_US 500000U

/// Who sent a nonzero command when, accepted or not. The gateway sees only what the bridge passes on.
typedef struct {
    struct {
        char name[BRIDGE_NAME_SIZE];
        uint64_t us; ///< 0: free.
    } source[BRIDGE_MOVERS_MAX];
} bridge_movers_t;

/// Notes a well-formed nonzero command of the source `name`.
void bridge_movers_note(bridge_movers_t *self, const char *name, uint64_t now_us);

/// The source because of which arm and reset are refused as `stale_command` now; NULL: there is none. `except` (NULL: no one) is not
/// counted: the holder, for an arm of another person, whom the gateway answers with `busy`.
const char *bridge_movers_who(const bridge_movers_t *self, const char *except, uint32_t lease_ms, uint64_t now_us);

#endif
