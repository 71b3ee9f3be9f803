// SPDX-License-Identifier: MIT
/// Simulated e-stop button: a unix stream socket that sends '0' (released) or '1' (pressed) on connect and at every
/// change.
///
/// A client without a connection must treat the button as pressed; `unplug` is the cut wire.
#ifndef SIM_BUTTON_H
#define SIM_BUTTON_H

#include "sim_loop.h"

#define SIM_BUTTON_CLIENTS 8U

typedef struct sim_button {
    sim_listener_t listener;
    sim_watch_t client[SIM_BUTTON_CLIENTS]; ///< fd -1: free.
    const sim_loop_t *loop;
    iw_time_us_t release_us; ///< End of a pulse; IW_NEVER: no pulse.
    bool pressed;
    bool unplugged;
} sim_button_t;

/// Opens the button: released, plugged in. `loop` must be set and exist as long as the button. Returns false, with the
/// reason, if that fails.
bool sim_button_open(sim_button_t *self, const char *path, sim_reason_t *out_reason);
void sim_button_close(sim_button_t *self);

void sim_button_press(sim_button_t *self, bool pressed);

void sim_button_pulse(sim_button_t *self, iw_time_us_t until_us);

/// Cuts the wire, or repairs it.
void sim_button_unplug(sim_button_t *self, bool unplugged);

/// Ends a pulse that is over. Returns true if it did.
bool sim_button_step(sim_button_t *self, iw_time_us_t now_us);

#endif
