// SPDX-License-Identifier: MIT
/// One connection of the northbound socket: bytes in, lines out.
///
/// Buffers are fixed. A full output buffer costs the client events (counted, and told by a `lost` event as soon as
/// there is room again); half of it is kept for replies, and a client that does not take even those is dropped.
/// Nothing here waits.
///
///     FREE --accept--> OPEN --end of file--> ENDED
///     OPEN, ENDED --sock_client_finish--> CLOSING --all is sent, or SOCK_CLOSING_US have passed--> FREE
///     OPEN, ENDED --an error--> BROKEN --sock_client_finish--> GONE --> FREE
///     CLOSING --an error, or nobody reads--> GONE
#ifndef SOCK_CLIENT_H
#define SOCK_CLIENT_H

#include "listener.h"

#include "iwheel/types.h"
#include "iwheel_northbound/request.h"

/// The longest reply or event with its newline.
#define SOCK_REPLY_MAX 65537U
/// Holds the longest reply behind the longest event.
#define SOCK_OUT_SIZE (2U * SOCK_REPLY_MAX)
/// A connection that is being closed gets this long to take what is left for it.
#define SOCK_CLOSING_US 1000000U
/// A request carried out this soon after its client had nothing waiting counts as sent when it is carried out.
#define SOCK_PROMPT_US 25000U

typedef enum {
    SOCK_OPEN = 0,
    SOCK_ENDED,   ///< Nothing more comes; complete lines that came before still count.
    SOCK_BROKEN,  ///< It cannot be written; what it has sent is read once more, for the stops in it.
    SOCK_CLOSING, ///< Nothing more is read; what is queued is sent.
    SOCK_GONE,    ///< Neither; its slot can be freed.
} sock_phase_t;

typedef struct sock_client {
    iw_client_t id; ///< Never used again for another connection; IW_CLIENT_NONE: the slot is free.
    int fd;
    int pid;   ///< Of the process that connected; 0 if unknown.
    uid_t uid; ///< Of its user.
    sock_right_t right;
    uint32_t interest; ///< What epoll was told to watch.
    sock_phase_t phase;
    // What the wait has found: each may be true in every phase.
    bool readable; ///< In this cycle.
    bool leaving;  ///< The other side will send nothing more, though lines of it may be waiting: it can hold no lease.
    bool hung_up;  ///< It reads nothing more either.
    // What its lines wait for: both may be true at once, for only the first holds up later lines.
    bool held;     ///< Its next line waits: an arm is not decided, or the relay has no room.
    bool owed;     ///< An answer is still to come; until then the connection is kept though it has ended.
    bool said;     ///< Beyond the maximum: its one line was carried out. True until it is freed, whatever the phase.
    uint32_t lost; ///< Events that did not fit since the last `lost` event.
    bool drained;  ///< The last read took all there was.
    iw_time_us_t caught_up_us; ///< Nothing of it was waiting then: what is there now was sent later.
    iw_time_us_t stopped_us;   ///< Somebody else has stopped the wheels then; 0: nobody has.
    iw_time_us_t line_us;      ///< Of a watcher: its next line is carried out no earlier.
    iw_time_us_t close_us;     ///< While closing, and beyond the maximum: no later than this.
    size_t in_length;
    size_t out_start;
    size_t out_end;
    char in[IWN_LINE_MAX + 1U];
    char out[SOCK_OUT_SIZE];
} sock_client_t;

/// Reads what is there, as far as the buffer has room. One system call.
void sock_client_read(sock_client_t *self);

/// The next complete line, without its newline. NULL: there is none. Valid until `sock_client_drop_line`.
const char *sock_client_line(const sock_client_t *self, size_t *out_length);
void sock_client_drop_line(sock_client_t *self, size_t length);

/// Notes that nothing of it was waiting at `then_us`, if the last read took all there was and no complete line is left.
/// What is known of a later time stays.
void sock_client_note_caught_up(sock_client_t *self, iw_time_us_t then_us);

/// The same for now, asking the socket.
void sock_client_check_caught_up(sock_client_t *self, iw_time_us_t now_us);

/// When a request of it that is carried out now was sent, as far as can be told: now, unless it may have waited for
/// more than SOCK_PROMPT_US or since before `since_us`.
iw_time_us_t sock_client_sent_us(const sock_client_t *self, iw_time_us_t now_us, iw_time_us_t since_us);

/// Whether a request of it that is carried out now may have been sent before somebody else stopped the wheels.
bool sock_client_waited_through_stop(const sock_client_t *self);

/// True if the buffer is full without a newline.
bool sock_client_line_too_long(const sock_client_t *self);

/// Queues a whole line. One that does not fit drops the client.
void sock_client_reply(sock_client_t *self, const char *line, size_t length);

/// Queues a whole line if half of the buffer is free, else counts it as lost.
void sock_client_event(sock_client_t *self, const char *line, size_t length);

/// Sends what is queued, as far as it goes. One system call.
void sock_client_flush(sock_client_t *self);
bool sock_client_flushed(const sock_client_t *self);

/// It cannot be read or written any more.
void sock_client_break(sock_client_t *self);

static inline bool sock_client_is_closing(const sock_client_t *self) {
    return self->phase == SOCK_CLOSING || self->phase == SOCK_GONE;
}

/// It cannot be written.
static inline bool sock_client_is_broken(const sock_client_t *self) {
    return self->phase == SOCK_BROKEN || self->phase == SOCK_GONE;
}

/// Nothing more is read; it is closed when it has taken what is queued.
void sock_client_finish(sock_client_t *self, iw_time_us_t now_us);

#endif
