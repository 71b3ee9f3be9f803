// SPDX-License-Identifier: MIT
/// The running simulator: the world in real time, with its sockets, its script and its log.
///
/// Simulated time is CLOCK_MONOTONIC. If the process itself stopped for more than SIM_PAUSE_US, the world stopped with
/// it: simulated time continues from where it was, and the simulator prints a message. Stamps in the log are always
/// CLOCK_MONOTONIC.
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
    char can_path[SIM_PATH_BYTES]; ///< Path of the local bus.
    char can_interface[16];        ///< SocketCAN interface instead of the local bus; empty: none.
    char estop_path[SIM_PATH_BYTES];
    char estop2_path[SIM_PATH_BYTES]; ///< Path of the second contact; empty: the button has none.
    char control_path[SIM_PATH_BYTES];
    const char *script_path; ///< NULL: none.
    const char *log_path;    ///< NULL: none.
    uint64_t seed;
    uint64_t age_us; ///< Time for which the wheels have been running; 0: they boot.
    bool quiet;
    bool no_keys; ///< Disables the keys on a terminal too.
    bool log_direction;
    char command[SIM_LINE_BYTES]; ///< Command for a running simulator; empty: run the simulator.
} sim_options_t;

/// Reads the command line. Returns -1 if the program must continue, otherwise the exit code; all messages for the user
/// have been printed.
int sim_options_read(sim_options_t *out_options, int argc, char **argv);

// --- the simulator -----------------------------------------------------------------------------------------------

/// A wake-up later than this is a pause; after a shorter delay the world catches up.
#define SIM_PAUSE_US 500000U

typedef struct {
    sim_world_t world;
    sim_loop_t loop;
    sim_hub_t hub;
    sim_socketcan_t can; ///< Used instead of the hub with SocketCAN.
    sim_button_t button;
    sim_button_t second; ///< Second contact of the same button; only if it has a socket.
    sim_control_t control;
    sim_keys_t keys;
    sim_script_t script;
    sim_bus_log_t log;
    sim_panel_t panel;
    sim_watch_t signals;
    iw_time_us_t now_us;     ///< Simulated time.
    iw_time_us_t start_us;   ///< Simulated time of the start.
    iw_time_us_t skipped_us; ///< CLOCK_MONOTONIC is ahead of simulated time by this.
    iw_time_us_t wake_us;    ///< Next time at which the simulator must act.
    bool quiet;
    bool on_socketcan;
    bool ended;
} sim_simulator_t;

/// Creates all parts. Returns -1, or the exit code after it has printed the cause and removed all parts again.
int sim_simulator_open(sim_simulator_t *self, const sim_options_t *options);

/// Runs until a command or a signal ends it.
void sim_simulator_run(sim_simulator_t *self);

void sim_simulator_close(sim_simulator_t *self);

#endif
