// SPDX-License-Identifier: MIT
/// The handle: a socket and a buffer of lines.
///
///     in: | taken | lines that are whole | one that is still coming | room |
///         0     begin                  whole                       end   IWC_IN_SIZE
///
/// A line is looked at once, when its newline comes. What nobody will ask for is struck out there, by a NUL in the place of its first
/// byte. When room runs out, events that a newer one supersedes go first, then the oldest.
#ifndef IWC_CONNECTION_H
#define IWC_CONNECTION_H

#include "iwheel_client/client.h"
#include "json.h"

#include <sys/types.h>
#include <sys/un.h>

/// Room for two lines that are kept, one that is coming, and one to read into.
#define IWC_IN_SIZE (4U * ((size_t)IWC_LINE_MAX + 1U))

struct iwc {
    int fd;            ///< -1: closed; what came before may still be taken.
    pid_t owner;       ///< The process that connected: a forked child may not speak for it.
    iwc_result_t over; ///< IWC_OK while the connection lives, else what became of it.
    bool watches;      ///< The gateway lets it watch and stop only.
    bool newer;        ///< The gateway speaks a protocol above IWC_PROTOCOL.
    int error_number;  ///< errno of the last iwc_connect.
    const sigset_t *let_in;
    sigset_t mask;    ///< What let_in points to.
    int64_t number;   ///< Of this connection, by the gateway.
    int64_t requests; ///< Sent so far. Ids are even where a call waits for the reply, odd where iwc_next brings it.
    int64_t awaited;  ///< The id that a call waits for; 0: none.
    size_t answer;    ///< The length of the answer to it in `line`; 0: not there yet.
    int64_t driven[IWC_DRIVES_MAX]; ///< Ids of drive commands without reply; 0: free.
    uint64_t skipped;               ///< Events left out since the last message that was taken.
    size_t begin;
    size_t whole;
    size_t end;
    char path[sizeof(((struct sockaddr_un *)NULL)->sun_path)];
    char error[64];
    char reason[1024];
    char line[IWC_LINE_MAX + 1U]; ///< The message handed out last, terminated.
    char in[IWC_IN_SIZE];
};

/// CLOCK_MONOTONIC, microseconds.
int64_t iwc_now_us(void);

/// When a wait of `timeout_ms` from now is over; INT64_MAX: never.
int64_t iwc_deadline_us(int timeout_ms);

/// The first half of `iwc_connect`: connects, and awaits no greeting.
iwc_result_t iwc_dial(iwc_t *self, const char *path, int64_t deadline_us);

/// Reads once. IWC_OK: something came; IWC_TIMEOUT: nothing is there; else the connection is over.
iwc_result_t iwc_fill(iwc_t *self);

/// Waits for `events` on the connection; with 0 on nothing but the time. IWC_OK, IWC_TIMEOUT, IWC_INTERRUPTED.
iwc_result_t iwc_await(const iwc_t *self, short events, int64_t deadline_us);

/// Sends a line whole or not at all; half a line ends the connection.
iwc_result_t iwc_put(iwc_t *self, const char *line, size_t length, int64_t deadline_us);

/// Ends the connection with that result. What came before stays.
void iwc_end(iwc_t *self, iwc_result_t result);

void iwc_keep_refusal(iwc_t *self, const iwc_message_t *reply);

/// Sends a request that stops through a connection of its own, by one socket of the gateway or the other: client_stop.c.
iwc_result_t iwc_stop_by(iwc_t *self, const char *path, const char *request, int timeout_ms);

// ---- the lines in the buffer: client_queue.c -----------------------------------------------------------------------------

/// Looks at what came since the last time. False: a line is no message, or too long; the good ones before it are kept.
bool iwc_queue_admit(iwc_t *self);

/// Hands out the oldest message, in `self->line`. False: there is none.
bool iwc_queue_take(iwc_t *self, iwc_message_t *out_message);

/// Leaves out, counted, every event of which a newer one is there, and then the oldest messages until half of the buffer is free.
void iwc_queue_thin(iwc_t *self);

/// Makes room to read into: a line at least.
void iwc_queue_make_room(iwc_t *self);

#endif
