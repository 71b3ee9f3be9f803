// SPDX-License-Identifier: MIT
/// A script: commands and the times at which they are executed.
///
///     # a comment
///     at 2.5 power off       seconds since the simulator's start; must not go back
///     wait 1.0               adds this number of seconds to the time
///     power on               at the time reached
///     wait 0.5 estop press   both in one line
///
/// The simulator reads the whole script at its start and first tries every command on a scratch world, so it refuses a
/// faulty script before anything moves.
#ifndef SIM_SCRIPT_H
#define SIM_SCRIPT_H

#include "sim_words.h"

#define SIM_SCRIPT_STEPS 512U

typedef struct {
    iw_time_us_t at_us; ///< Time since the start.
    char command[SIM_LINE_BYTES];
} sim_script_step_t;

typedef struct {
    sim_script_step_t step[SIM_SCRIPT_STEPS];
    unsigned count;
    unsigned next;
} sim_script_t;

/// Reason for the refusal of a script.
typedef struct {
    unsigned line; ///< Line number; 0: the file as a whole.
    char reason[384];
} sim_script_fault_t;

/// Loads a script. `check` returns NULL if a command is valid, otherwise the reason of the refusal. Returns false, with
/// the fault, if the script cannot be read or is not valid.
bool sim_script_load(sim_script_t *self, const char *path, const char *(*check)(void *context, const char *command),
                     void *context, sim_script_fault_t *out_fault);

/// Returns the next command that is due by `elapsed_us`, once; NULL if there is none.
const char *sim_script_take(sim_script_t *self, iw_time_us_t elapsed_us);

/// Returns the time of the next command; IW_NEVER: the script is over.
iw_time_us_t sim_script_next_us(const sim_script_t *self);

#endif
