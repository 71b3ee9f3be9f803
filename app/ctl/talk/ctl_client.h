// SPDX-License-Identifier: MIT
/// The connection to the gateway as the verbs use it: libiwheel-client, with jansson's objects and signals that are counted.
///
/// Nothing here blocks longer than the deadline it is given (CLOCK_MONOTONIC, microseconds). IWC_INTERRUPTED: a signal caught by
/// `signals_catch` that `seen_signals` does not count yet.
#ifndef CTL_CLIENT_H
#define CTL_CLIENT_H

#include "iwheel_client/client.h"

#include <jansson.h>
#include <signal.h>

/// A gateway that is there answers within milliseconds.
#define CLIENT_REPLY_US 2000000

typedef struct {
    iwc_t *gateway;
    bool
        open; ///< `client_open` has succeeded and nobody has closed it: what the gateway ended is not opened anew by itself.
    unsigned seen_signals;
    uint64_t skipped; ///< Events left out so far; whoever tells them sets it to 0.
    const char *line; ///< The last line received, terminated; valid until the next receive.
} client_t;

/// Monotonic time.
int64_t client_now_us(void);

/// Nothing connected. False: out of memory.
bool client_init(client_t *self);
void client_free(client_t *self);

/// As `iwc_connect`; a newer protocol is no reason not to talk.
iwc_result_t client_open(client_t *self, const char *path, int64_t deadline_us);

/// Ends the connection, if there is one.
void client_close(client_t *self);

/// Sends `request`, whose reference it takes, after giving it an id, `*out_id`. IWC_FULL: it could not leave, and is forgotten.
iwc_result_t client_send(client_t *self, json_t *request, int64_t deadline_us, int64_t *out_id);

/// The next line, as a new reference in `*out_line` (null unless IWC_OK).
iwc_result_t client_receive(client_t *self, int64_t deadline_us, json_t **out_line);

/// Sends `request`, whose reference it takes, and receives until its reply comes; what comes before is dropped.
iwc_result_t client_ask(client_t *self, json_t *request, json_t **out_reply);

// --- SIGINT, SIGTERM and SIGHUP, counted instead of deadly, and only where the program waits ---------------------

/// From now on the three are blocked, except in a wait that uses `signals_let_in`, and counted there.
void signals_catch(void);

/// How many came.
unsigned signals_count(void);

/// The mask for ppoll. A null pointer, which leaves the mask as it is, without `signals_catch`.
const sigset_t *signals_let_in(void);

#endif
