// SPDX-License-Identifier: MIT
/// A connection to the gateway: lines out, lines in, never waiting without an end.
///
/// One JSON object per line. Nothing here blocks longer than the deadline it is given (CLOCK_MONOTONIC, microseconds).
#ifndef CLIENT_H
#define CLIENT_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Longest reply or event, without its newline.
#define CLIENT_LINE_MAX 65536U
/// A gateway that is there answers within milliseconds.
#define CLIENT_REPLY_US 2000000

typedef enum {
    CLIENT_OK = 0,
    CLIENT_TIMEOUT,
    CLIENT_CLOSED,      ///< The gateway ended the connection, or it broke.
    CLIENT_GARBLED,     ///< Something that is not one JSON object, or a line too long.
    CLIENT_INTERRUPTED, ///< A signal caught by signals.h that `seen_signals` does not count yet.
} client_result_t;

typedef struct {
    int socket; ///< -1: not connected.
    unsigned seen_signals;
    int64_t next_id;
    size_t begin; ///< Unread bytes are [begin, end) of buffer.
    size_t end;
    const char *line; ///< The last line received, terminated; valid until the next receive.
    char buffer[CLIENT_LINE_MAX + 2U];
} client_t;

/// Monotonic time.
int64_t client_now_us(void);

/// Nothing connected.
void client_init(client_t *self);

/// Connects to the unix stream socket at `path`. 0, or an errno value: ETIMEDOUT if its queue of callers stays full, ENAMETOOLONG if no
/// address holds the path.
int client_open(client_t *self, const char *path, int64_t deadline_us);

void client_close(client_t *self);

/// Sends `request`, whose reference it takes, after giving it the field `id`. `*out_id` is that id.
client_result_t client_send(client_t *self, json_t *request, int64_t deadline_us, int64_t *out_id);

/// The next line, as a new reference in `*out_line` (null unless CLIENT_OK).
client_result_t client_receive(client_t *self, int64_t deadline_us, json_t **out_line);

/// Receives until the reply to `id` comes; events and replies to other requests are dropped. A reply without id is taken too: it is a refusal
/// of the whole connection or of a line.
client_result_t client_wait(client_t *self, int64_t id, int64_t deadline_us, json_t **out_reply);

#endif
