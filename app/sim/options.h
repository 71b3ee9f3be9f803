// SPDX-License-Identifier: MIT
/// The command line of iwheel-sim.
#ifndef SIM_OPTIONS_H
#define SIM_OPTIONS_H

#include "words.h"

#define SIM_PATH_BYTES 512U

typedef struct {
    char can_path[SIM_PATH_BYTES]; ///< Of the local bus.
    char can_interface[16];        ///< SocketCAN instead of it; empty: none.
    char estop_path[SIM_PATH_BYTES];
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

#endif
