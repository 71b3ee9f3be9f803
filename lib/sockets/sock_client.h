// SPDX-License-Identifier: MIT
/// One connection of the northbound socket: received bytes, and lines to send.
///
/// The buffers have a fixed size. If the output buffer is full, events are lost; they are counted, and a `lost` event
/// reports them when there is space again. Half of the buffer is reserved for replies, and a client that does not
/// receive these either is dropped. No function waits.
///
///     FREE --accept--> OPEN --end of file--> ENDED
///     OPEN, ENDED --sock_client_finish--> CLOSING --all is sent, or SOCK_CLOSING_US have passed--> FREE
///     OPEN, ENDED --an error--> BROKEN --sock_client_finish--> GONE --> FREE
///     CLOSING --an error, or the peer has gone--> GONE
#ifndef SOCK_CLIENT_H
#define SOCK_CLIENT_H

#include "listener.h"

#include "iwheel/types.h"
#include "iwheel_northbound/request.h"

/// Longest reply or event with its newline.
#define SOCK_REPLY_MAX 65537U
/// Size for the longest reply after the longest event.
#define SOCK_OUT_SIZE (2U * SOCK_REPLY_MAX)
/// Time for a closing connection to receive the rest of its lines.
#define SOCK_CLOSING_US 1000000U
/// A request that is executed within this time after its client had nothing waiting counts as sent at its execution.
#define SOCK_PROMPT_US 25000U

typedef enum {
    SOCK_OPEN = 0,
    SOCK_ENDED,   ///< The client sends nothing more; complete lines from before are still executed.
    SOCK_BROKEN,  ///< Writing fails. Only the last search for stop requests still reads.
    SOCK_CLOSING, ///< Only the last search for stop requests still reads; queued lines are sent.
    SOCK_GONE,    ///< Neither; the slot can be freed.
} sock_phase_t;

typedef struct sock_client {
    iw_client_t id; ///< Never reused for another connection; IW_CLIENT_NONE if the slot is free.
    int fd;
    int pid;   ///< Process that connected; 0 if unknown.
    uid_t uid; ///< User of that process.
    sock_right_t right;
    uint32_t interest; ///< Events that epoll watches for.
    sock_phase_t phase;
    // Results of the wait: each may be true in every phase.
    bool readable; ///< It can be read in this cycle.
    bool leaving;  ///< The peer sends nothing more and can hold no lease, but lines from before may be waiting.
    bool hung_up;  ///< The peer does not read either.
    // Reasons to wait: both may be true, because only the first one delays later lines.
    bool held;     ///< Its next line waits: an arm is not decided, or the relay has no space.
    bool owed;     ///< A reply is still to come; until then the connection stays open even if it has ended.
    bool executed; ///< Beyond the maximum: its one line was executed. True until the slot is freed, in every phase.
    uint32_t lost; ///< Number of events that did not fit since the last `lost` event.
    bool drained;  ///< The last read returned all available bytes.
    iw_time_us_t caught_up_us; ///< Time at which nothing of it was waiting: later bytes were sent after it.
    iw_time_us_t stopped_us;   ///< Time at which another client stopped the wheels; 0 if none has.
    iw_time_us_t line_us;      ///< For a watcher: earliest time of its next line.
    iw_time_us_t close_us;     ///< While closing, and beyond the maximum: latest time.
    size_t in_length;
    size_t out_start;
    size_t out_end;
    char in[IWN_LINE_MAX + 1U];
    char out[SOCK_OUT_SIZE];
} sock_client_t;

/// Reads as many bytes as fit in the buffer, if the client is OPEN. One system call.
void sock_client_read(sock_client_t *self);

/// Returns the next complete line without its newline, or NULL. It is valid until `sock_client_drop_line`.
const char *sock_client_line(const sock_client_t *self, size_t *out_length);
/// Removes this line, which is one of the buffer.
void sock_client_drop_line(sock_client_t *self, const char *line, size_t length);

/// Returns the next complete line from `*at` on that may be a stop request, or NULL. `*at` is then after it; it begins
/// with 0.
const char *sock_client_next_stop(const sock_client_t *self, size_t *at, size_t *out_length);

/// Drops the first `searched` bytes and reads on, in every phase. Returns false if nothing more is waiting. One system
/// call.
bool sock_client_read_on(sock_client_t *self, size_t searched);

/// Records that nothing of it was waiting at `then_us`, if the last read returned all bytes and no complete line is
/// left. A later recorded time is retained.
void sock_client_note_caught_up(sock_client_t *self, iw_time_us_t then_us);

/// Does the same for now, by querying the socket.
void sock_client_check_caught_up(sock_client_t *self, iw_time_us_t now_us);

/// Returns the time at which a request that is executed now was sent, as far as known: now, unless it may have waited
/// for more than SOCK_PROMPT_US or since before `since_us`.
iw_time_us_t sock_client_sent_us(const sock_client_t *self, iw_time_us_t now_us, iw_time_us_t since_us);

/// Returns true if a request that is executed now may have been sent before another client stopped the wheels.
bool sock_client_waited_through_stop(const sock_client_t *self);

/// Returns true if the buffer is full without a newline.
bool sock_client_line_too_long(const sock_client_t *self);

/// Queues a whole line. If it does not fit, the client is dropped.
void sock_client_reply(sock_client_t *self, const char *line, size_t length);

/// Queues a whole line if half of the buffer is free; otherwise counts it as lost.
void sock_client_event(sock_client_t *self, const char *line, size_t length);

/// Sends queued bytes as far as possible. One system call.
void sock_client_flush(sock_client_t *self);
bool sock_client_flushed(const sock_client_t *self);

/// Marks a connection that can be neither read nor written.
void sock_client_break(sock_client_t *self);

static inline bool sock_client_is_closing(const sock_client_t *self) {
    return self->phase == SOCK_CLOSING || self->phase == SOCK_GONE;
}

/// Returns true if it cannot be written.
static inline bool sock_client_is_broken(const sock_client_t *self) {
    return self->phase == SOCK_BROKEN || self->phase == SOCK_GONE;
}

/// Closes the connection after it has received its queue.
void sock_client_finish(sock_client_t *self, iw_time_us_t now_us);

#endif
