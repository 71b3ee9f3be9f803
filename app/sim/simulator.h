// SPDX-License-Identifier: MIT
/// The running simulator: the world in real time, with its sockets, its script and its log.
///
/// Simulated time is CLOCK_MONOTONIC. If the process itself stood still for more than SIM_PAUSE_US the world stood
/// still with it: simulated time goes on where it was, and it is told. Stamps in the log are CLOCK_MONOTONIC in any
/// case.
#ifndef SIM_SIMULATOR_H
#define SIM_SIMULATOR_H

#include "bus_log.h"
#include "button.h"
#include "control.h"
#include "hub.h"
#include "keys.h"
#include "options.h"
#include "panel.h"
#include "script.h"
#include "socketcan.h"

/// Later than this is a pause, not a delay to catch up with.
#define SIM_PAUSE_US 500000U

typedef struct {
    sim_world_t world;
    sim_loop_t loop;
    sim_hub_t hub;
    sim_socketcan_t can; ///< In place of the hub.
    sim_button_t button;
    sim_control_t control;
    sim_keys_t keys;
    sim_script_t script;
    sim_bus_log_t log;
    sim_panel_t panel;
    sim_watch_t signals;
    iw_time_us_t now_us;     ///< Simulated.
    iw_time_us_t start_us;   ///< Simulated.
    iw_time_us_t skipped_us; ///< CLOCK_MONOTONIC is ahead of simulated time by this.
    iw_time_us_t wake_us;    ///< When the world next needs us.
    bool quiet;
    bool on_socketcan;
    bool ended;
} sim_simulator_t;

/// Makes everything; does not return an unfinished simulator. -1, or the exit code with everything told and undone.
int sim_simulator_open(sim_simulator_t *self, const sim_options_t *options);

/// Runs until told to end.
void sim_simulator_run(sim_simulator_t *self);

void sim_simulator_close(sim_simulator_t *self);

#endif
