// SPDX-License-Identifier: MIT
/// Faults at the touch of a key, while the simulator is in the foreground of a terminal.
///
/// A key stands for a command of the panel and, pressed again, for the one that takes it back. What others do through the control
/// socket is not followed; `normal` clears all.
#ifndef SIM_KEYS_H
#define SIM_KEYS_H

#include "sim_loop.h"

#include <stddef.h>
#include <termios.h>

typedef struct {
    sim_watch_t watch; ///< Of standard input; fd -1: no keys.
    const sim_loop_t *loop;
    /// Does what the line says; the answer begins with "error" if it cannot.
    const char *(*execute)(void *context, const char *line);
    void *context;
    struct termios before; ///< The terminal as it was.
    unsigned on;           ///< One bit for each row of the table.
} sim_keys_t;

/// Takes the keys if standard input and output are a terminal that is ours; else there are none. `loop`, `execute` and
/// `context` must be set.
void sim_keys_open(sim_keys_t *self);

/// Leaves the terminal as it was.
void sim_keys_close(sim_keys_t *self);

#endif
