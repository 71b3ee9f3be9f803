// SPDX-License-Identifier: MIT
/// Keys that set and clear faults while the simulator runs in the foreground of a terminal.
///
/// The first press of a key executes a command of the panel, the second press the command that undoes it. Commands from
/// the control socket do not change the state of the keys; the key of `normal` clears all.
#ifndef SIM_KEYS_H
#define SIM_KEYS_H

#include "sim_loop.h"

#include <stddef.h>
#include <termios.h>

typedef struct {
    sim_watch_t watch; ///< Watch of standard input; fd -1: no keys.
    const sim_loop_t *loop;
    /// Executes the command in `line`. The answer begins with "error" if that fails.
    const char *(*execute)(void *context, const char *line);
    void *context;
    struct termios before; ///< Settings of the terminal before.
    unsigned on;           ///< One bit for each row of the table.
} sim_keys_t;

/// Enables the keys if standard input and output are a terminal and this process is in its foreground; otherwise there
/// are no keys. `loop`, `execute` and `context` must be set.
void sim_keys_open(sim_keys_t *self);

/// Restores the settings of the terminal.
void sim_keys_close(sim_keys_t *self);

#endif
