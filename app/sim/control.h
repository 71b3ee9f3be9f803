// SPDX-License-Identifier: MIT
/// Control socket: a unix stream socket with one command per line and one answer to each command (see panel.h).
///
/// The simulator closes a connection if a line is longer than SIM_LINE_BYTES, or if the client does not read its
/// answers.
#ifndef SIM_CONTROL_H
#define SIM_CONTROL_H

#include "sim_loop.h"
#include "sim_words.h"

#define SIM_CONTROL_CLIENTS 8U

typedef struct {
    sim_watch_t watch;
    struct sim_control *control;
    size_t used;
    char line[SIM_LINE_BYTES];
} sim_control_client_t;

typedef struct sim_control {
    sim_listener_t listener;
    sim_control_client_t client[SIM_CONTROL_CLIENTS];
    const sim_loop_t *loop;
    /// Executes the command in `line`. The answer stays valid until the next call.
    const char *(*execute)(void *context, const char *line);
    void *context;
} sim_control_t;

/// Opens the socket. `loop`, `execute` and `context` must be set. Returns false, with the reason, if that fails.
bool sim_control_open(sim_control_t *self, const char *path, sim_reason_t *out_reason);
void sim_control_close(sim_control_t *self);

#endif
