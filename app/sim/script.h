// SPDX-License-Identifier: MIT
/// A script: which commands to give when.
///
///     # a comment
///     at 2.5 power off       seconds since the simulator's start; must not go back
///     wait 1.0               moves on by so much
///     power on               at the time reached
///     wait 0.5 estop press   both in one
///
/// Read whole at the start. Every command is tried on a scratch world first, so a faulty script is refused before
/// anything moves.
#ifndef SIM_SCRIPT_H
#define SIM_SCRIPT_H

#include "sim_words.h"

#define SIM_SCRIPT_STEPS 512U

typedef struct {
    iw_time_us_t at_us; ///< Since the start.
    char command[SIM_LINE_BYTES];
} sim_script_step_t;

typedef struct {
    sim_script_step_t step[SIM_SCRIPT_STEPS];
    unsigned count;
    unsigned next;
} sim_script_t;

/// Why a script was refused.
typedef struct {
    unsigned line; ///< 0: the file as a whole.
    char reason[384];
} sim_script_fault_t;

/// `check` says NULL if a command is right, else why not. False, with the fault, if the script cannot be read or is not
/// right.
bool sim_script_load(sim_script_t *self, const char *path, const char *(*check)(void *context, const char *command),
                     void *context, sim_script_fault_t *out_fault);

/// The next command due by `elapsed_us`, once; NULL if there is none.
const char *sim_script_take(sim_script_t *self, iw_time_us_t elapsed_us);

/// When the next command is due; IW_NEVER: the script is over.
iw_time_us_t sim_script_next_us(const sim_script_t *self);

#endif
