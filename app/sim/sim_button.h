// SPDX-License-Identifier: MIT
/// The simulated e-stop button: a unix stream socket that tells '0' (released) or '1' (pressed) on connect and at every
/// change.
///
/// Whoever is connected to nothing must take it for pressed; `unplug` is the cut wire.
#ifndef SIM_BUTTON_H
#define SIM_BUTTON_H

#include "sim_loop.h"

#define SIM_BUTTON_CLIENTS 8U

typedef struct sim_button {
    sim_listener_t listener;
    sim_watch_t client[SIM_BUTTON_CLIENTS]; ///< fd -1: free.
    const sim_loop_t *loop;
    iw_time_us_t release_us; ///< A pulse ends here; IW_NEVER: none.
    bool pressed;
    bool unplugged;
} sim_button_t;

/// Released, plugged in. `loop` must be set and outlive it.
bool sim_button_open(sim_button_t *self, const char *path, sim_reason_t *out_reason);
void sim_button_close(sim_button_t *self);

void sim_button_press(sim_button_t *self, bool pressed);

void sim_button_pulse(sim_button_t *self, iw_time_us_t until_us);

/// Cuts the wire, or mends it.
void sim_button_unplug(sim_button_t *self, bool unplugged);

/// Ends a pulse that is over. True if it did.
bool sim_button_step(sim_button_t *self, iw_time_us_t now_us);

#endif
