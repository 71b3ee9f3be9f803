// SPDX-License-Identifier: MIT
/// Private to the library: the handle, which is a socket and a buffer of lines.
///
///     in: | read by the caller | whole lines | incomplete line | free |
///         0                  begin         whole              end   IWC_IN_SIZE
///
/// The library examines a line once, when its newline comes. It strikes out a line that no call will read, by a NUL as
/// its first byte. When the buffer is full, it drops events that a newer one supersedes, then the oldest messages.
#ifndef IWC_CONNECTION_H
#define IWC_CONNECTION_H

#include "iwheel_client/client.h"
#include "json.h"

#include <sys/types.h>
#include <sys/un.h>

/// Size of the buffer: two stored lines, an incomplete one, and one to read into.
#define IWC_IN_SIZE (4U * ((size_t)IWC_LINE_MAX + 1U))

struct iwc {
    int fd;            ///< -1: closed; the caller may still read messages that came before.
    pid_t owner;       ///< The process that connected. A forked child must not send on the connection.
    iwc_result_t over; ///< IWC_OK while the connection exists, otherwise the result with which it ended.
    bool watches;      ///< The gateway permits only watching and stopping.
    bool newer;        ///< The gateway's protocol is above IWC_PROTOCOL.
    int error_number;  ///< errno of the last iwc_connect.
    const sigset_t *let_in;
    sigset_t mask;    ///< The mask to which let_in points.
    int64_t number;   ///< Number that the gateway assigned to this connection.
    int64_t requests; ///< Requests sent. Ids are even if a call waits for the reply, odd if iwc_next returns it.
    int64_t awaited;  ///< The id for which a call waits; 0: none.
    size_t answer;    ///< Length of the reply to `awaited` in `line`; 0: it has not come yet.
    int64_t driven[IWC_DRIVES_MAX]; ///< Ids of drive commands without reply; 0: free.
    uint64_t skipped;               ///< Events dropped since the last message that the caller read.
    size_t begin;
    size_t whole;
    size_t end;
    char path[sizeof(((struct sockaddr_un *)NULL)->sun_path)];
    iwc_result_t failed; ///< Result of the last call that failed; IWC_OK: none has failed on this connection.
    char error[64];
    char reason[1024];
    iwc_stored_t stored;
    char line[IWC_LINE_MAX + 1U]; ///< The last message that the caller received, terminated.
    char in[IWC_IN_SIZE];
};

/// Returns CLOCK_MONOTONIC in microseconds.
int64_t iwc_now_us(void);

/// Returns the end of a wait of `timeout_ms` from now; INT64_MAX: never.
int64_t iwc_deadline_us(int timeout_ms);

/// Connects, without waiting for the greeting: the first half of `iwc_connect`.
iwc_result_t iwc_dial(iwc_t *self, const char *path, int64_t deadline_us);

/// Reads once from the socket. Returns IWC_OK if bytes came, IWC_TIMEOUT if there are none; otherwise the connection
/// has ended.
iwc_result_t iwc_fill(iwc_t *self);

/// Waits for `events` on the connection; 0: only for the time. Returns IWC_OK, IWC_TIMEOUT or IWC_INTERRUPTED.
iwc_result_t iwc_await(const iwc_t *self, short events, int64_t deadline_us);

/// Sends a whole line or nothing; if only part of a line could be sent, ends the connection.
iwc_result_t iwc_put(iwc_t *self, const char *line, size_t length, int64_t deadline_us);

/// Ends the connection with that result. Received messages stay.
void iwc_end(iwc_t *self, iwc_result_t result);

/// Stores a result that is a failure for `iwc_reason`. Returns the result.
iwc_result_t iwc_note(iwc_t *self, iwc_result_t result);

/// Stores name and message of a refusal for `iwc_error` and `iwc_reason`.
void iwc_store_refusal(iwc_t *self, const iwc_message_t *reply);

/// Finds as `iwc_find` does with NULL, but writes a terminator behind each path. `*out_length` is the length of all.
iwc_result_t iwc_find_paths(char *out, size_t size, size_t *out_length);

/// Sends a stop request through a connection of its own, to one of the gateway's two sockets: client_stop.c. Without
/// `path` and with several gateways it sends the request to each of them.
iwc_result_t iwc_stop_by(iwc_t *self, const char *path, const char *request, int timeout_ms);

// ---- the lines in the buffer: client_queue.c
// -----------------------------------------------------------------------------

/// Examines the lines that have come since the last call. Returns false if a line is not a message or too long; the
/// valid lines before it stay.
bool iwc_queue_admit(iwc_t *self);

/// Moves the oldest message to `self->line`. Returns false if there is none.
bool iwc_queue_take(iwc_t *self, iwc_message_t *out_message);

/// Drops and counts every event that a newer one supersedes, and then the oldest messages until half of the buffer is
/// free.
void iwc_queue_thin(iwc_t *self);

/// Frees space in the buffer for at least one line.
void iwc_queue_make_room(iwc_t *self);

#endif
