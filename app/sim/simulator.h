// SPDX-License-Identifier: MIT
/// The running simulator: the world in real time, with its sockets, its script and its log.
///
/// Simulated time is CLOCK_MONOTONIC. If the process itself stood still for more than SIM_PAUSE_US the world stood
/// still with it: simulated time goes on where it was, and it is told. Stamps in the log are CLOCK_MONOTONIC in any
/// case.
#ifndef SIM_SIMULATOR_H
#define SIM_SIMULATOR_H

#include "bus_log.h"
#include "control.h"
#include "hub.h"
#include "keys.h"
#include "panel.h"
#include "script.h"
#include "sim_button.h"
#include "sim_socketcan.h"
#include "sim_words.h"

// --- the command line (sim_options.c) --------------------------------------------------------------------------------

#define SIM_PATH_BYTES 512U

typedef struct {
    char can_path[SIM_PATH_BYTES]; ///< Of the local bus.
    char can_interface[16];        ///< SocketCAN instead of it; empty: none.
    char estop_path[SIM_PATH_BYTES];
    char estop2_path[SIM_PATH_BYTES]; ///< Of its second contact; empty: it has none.
    char control_path[SIM_PATH_BYTES];
    const char *script_path; ///< NULL: none.
    const char *log_path;    ///< NULL: none.
    uint64_t seed;
    uint64_t age_us; ///< Wheels have been running this long already; 0: they boot.
    bool quiet;
    bool no_keys; ///< On a terminal, too, no key plants a fault.
    bool log_direction;
    char command[SIM_LINE_BYTES]; ///< To give to a running simulator; empty: be one.
} sim_options_t;

/// Returns -1 if the program shall go on, else the exit code to end with; everything the user must know has been
/// printed.
int sim_options_read(sim_options_t *out_options, int argc, char **argv);

// --- the simulator -----------------------------------------------------------------------------------------------

/// Later than this is a pause, not a delay to catch up with.
#define SIM_PAUSE_US 500000U

typedef struct {
    sim_world_t world;
    sim_loop_t loop;
    sim_hub_t hub;
    sim_socketcan_t can; ///< In place of the hub.
    sim_button_t button;
    sim_button_t second; ///< Contact of the same button; only if it has a socket.
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
