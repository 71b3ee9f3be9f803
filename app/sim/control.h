// SPDX-License-Identifier: MIT
/// The control socket: a unix stream socket, one command a line, one answer to each (see panel.h).
///
/// A line longer than SIM_LINE_BYTES, or a client that does not read its answers, ends that connection.
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
    /// Does what the line says; the answer stays valid until the next call.
    const char *(*execute)(void *context, const char *line);
    void *context;
} sim_control_t;

/// `loop`, `execute` and `context` must be set.
bool sim_control_open(sim_control_t *self, const char *path, sim_reason_t *out_reason);
void sim_control_close(sim_control_t *self);

#endif
