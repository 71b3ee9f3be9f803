// SPDX-License-Identifier: MIT
/// The drive connections of a bridge: one per person, with the key that proves this person's right to drive.
///
///     FREE --arm--> ASKING --granted--> HELD --end--> ENDING --0.4 s, or needed again--> FREE
///                     |                   |
///                     +---- refused ------+---- closed, not_holder ----> FREE
///
/// There are two places: that of the holder and that of a person who asks. No other person has a drive connection. The
/// gateway decides who holds the lease. For the gateway two people are two clients: the second one receives `busy` with
/// the name of the first, and `takeover` moves the lease only at standstill. Names are labels for messages. The key is
/// the right to drive; only the person who armed receives it.
#ifndef BRIDGE_LEASE_H
#define BRIDGE_LEASE_H

#include "bridge_line.h"
#include "secret.h"

/// Size of the longest name of a person with its terminator.
#define BRIDGE_NAME_SIZE 65U
/// The gateway answers an arm within this time, because it first verifies an echo.
#define BRIDGE_ARM_US 1000000U
/// A drive command without a reply after this time is answered with NULL.
#define BRIDGE_DRIVE_US 1000000U
/// The connection of a holder stays for this time after the end of the lease, so that the stop reaches the gateway
/// before the end of the connection.
#define BRIDGE_ENDING_US 400000U

typedef enum {
    BRIDGE_LEASE_OK,    ///< Sent; the answer follows.
    BRIDGE_LEASE_BUSY,  ///< Another person asks.
    BRIDGE_LEASE_AWAY,  ///< There is no gateway.
    BRIDGE_LEASE_WRONG, ///< No key, or not the key of the holder.
    BRIDGE_LEASE_FULL   ///< The gateway does not answer: the command is dropped.
} bridge_lease_result_t;

typedef enum { BRIDGE_FREE, BRIDGE_ASKING, BRIDGE_HELD, BRIDGE_ENDING } bridge_place_state_t;

typedef struct bridge_lease bridge_lease_t;
typedef struct bridge_place bridge_place_t;

/// Receiver of an answer. `answer` NULL: it is not needed.
typedef struct {
    bridge_answer_t answer;
    void *context;
} bridge_asker_t;

/// A drive command without a reply.
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
    bool key_is_gateways;              ///< The gateway issued the key, and requires it in each drive.
    char request[BRIDGE_REQUEST_SIZE]; ///< ASKING: the arm, until it is sent; then empty.
    bridge_asker_t asker;              ///< ASKING: receiver of the reply to arm.
    uint64_t until_us;                 ///< ASKING, ENDING: deadline.
    bridge_driven_t driven[BRIDGE_LINE_MAX];
};

struct bridge_lease {
    bridge_place_t place[2];
    bridge_place_t *holder; ///< NULL: no person holds the lease through this bridge.
};

/// Returns false if there is no memory. `socket` must outlive it; `epoll_fd` is that of the link. It must not be moved.
bool bridge_lease_open(bridge_lease_t *self, const char *socket, int epoll_fd);
void bridge_lease_close(bridge_lease_t *self);

/// Connects, reads, and drops requests whose reply is overdue.
void bridge_lease_step(bridge_lease_t *self, uint64_t now_us);
uint64_t bridge_lease_next_us(const bridge_lease_t *self, uint64_t now_us);

/// The person `name` asks for the lease with this `arm` request. BRIDGE_LEASE_OK: the answer is called once later. If
/// the reply grants the lease, `bridge_lease_key` is the key of this person, already during that call.
bridge_lease_result_t bridge_lease_arm(bridge_lease_t *self, const char *name, const char *request,
                                       bridge_asker_t asker, uint64_t now_us);

/// Returns the key of the holder; NULL: no person holds the lease through this bridge.
const char *bridge_lease_key(const bridge_lease_t *self);
/// Returns the name of the holder; NULL: no person holds it.
const char *bridge_lease_name(const bridge_lease_t *self);
/// Returns true if `key` is that of the holder. NULL is no key.
bool bridge_lease_is_holder(const bridge_lease_t *self, const char *key);

/// Sends one `drive` or `twist` of the person who has `key`, once. BRIDGE_LEASE_OK: the answer is called later. A reply
/// `not_holder` ends the lease.
bridge_lease_result_t bridge_lease_drive(bridge_lease_t *self, const char *key, const char *request,
                                         bridge_asker_t asker, uint64_t now_us);

/// Ends the lease of this bridge: a stop was requested or reported, or the person is gone. After this call no key is
/// valid, and a pending arm is answered with NULL. It sends nothing: the caller sends the stop.
void bridge_lease_end(bridge_lease_t *self, uint64_t now_us);

/// Discards the answers for this context. A pending arm of this context does not receive the lease.
void bridge_lease_forget(bridge_lease_t *self, const void *context);

// ---- deflected sticks -----------------------------------------------------------------------------------------------

/// Largest number of sources whose last nonzero command is stored.
#define BRIDGE_MOVERS_MAX 16U
/// Arm and reset are refused for this time after the last nonzero command of a source, or for the lease if that is
/// longer.
#define BRIDGE_MOVER_US 500000U

/// Time of the last nonzero command of each source, accepted or not. The gateway sees only the commands that the bridge
/// passes on.
typedef struct {
    struct {
        char name[BRIDGE_NAME_SIZE];
        uint64_t us; ///< 0: free.
    } source[BRIDGE_MOVERS_MAX];
} bridge_movers_t;

/// Stores the time of a well-formed nonzero command of the source `name`.
void bridge_movers_note(bridge_movers_t *self, const char *name, uint64_t now_us);

/// Returns the source for which arm and reset are refused as `stale_command` now; NULL if there is none. `except`
/// (NULL: none) is not counted: the holder, for an arm of another person, because the gateway answers that arm with
/// `busy`.
const char *bridge_movers_who(const bridge_movers_t *self, const char *except, uint32_t lease_ms, uint64_t now_us);

#endif
