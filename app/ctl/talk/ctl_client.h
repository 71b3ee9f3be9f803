// SPDX-License-Identifier: MIT
/// Connection of the verbs to the gateway: libiwheel-client, with objects of jansson and counted signals.
///
/// No function blocks longer than its deadline (CLOCK_MONOTONIC, microseconds). IWC_INTERRUPTED means a signal caught
/// by `signals_catch` that `seen_signals` does not count yet.
#ifndef CTL_CLIENT_H
#define CTL_CLIENT_H

#include "iwheel_client/client.h"

#include <jansson.h>
#include <signal.h>

/// A working gateway answers within milliseconds.
#define CLIENT_REPLY_US 2000000

typedef struct {
    iwc_t *gateway;
    bool open; ///< Open, and not closed by this program. It is not reopened automatically.
    unsigned seen_signals;
    uint64_t skipped; ///< Number of dropped events; set to 0 after a report.
    const char *line; ///< Last line received, terminated; valid until the next receive.
} client_t;

/// Returns the monotonic time.
int64_t client_now_us(void);

/// Initialises a client without a connection. Returns false if out of memory.
bool client_init(client_t *self);
void client_free(client_t *self);

/// Connects as `iwc_connect` does; a newer protocol is accepted.
iwc_result_t client_open(client_t *self, const char *path, int64_t deadline_us);

/// Closes the connection if there is one.
void client_close(client_t *self);

/// Sends `request` (releases its reference) with a new id, `*out_id`. IWC_FULL: it could not be sent and is dropped.
iwc_result_t client_send(client_t *self, json_t *request, int64_t deadline_us, int64_t *out_id);

/// Receives the next line as a new reference in `*out_line` (NULL unless IWC_OK).
iwc_result_t client_receive(client_t *self, int64_t deadline_us, json_t **out_line);

/// Sends `request` (releases its reference) and receives until its reply arrives; earlier lines are dropped.
iwc_result_t client_ask(client_t *self, json_t *request, json_t **out_reply);

// --- SIGINT, SIGTERM and SIGHUP: counted, and only while the program waits ----------------------------------------

/// Blocks the three signals from now on, except in a wait that uses `signals_let_in`, and counts them there.
void signals_catch(void);

/// Returns the number of signals so far.
unsigned signals_count(void);

/// Returns the mask for ppoll. Without `signals_catch` it is a null pointer, which leaves the mask unchanged.
const sigset_t *signals_let_in(void);

#endif
