// SPDX-License-Identifier: MIT
/// Gives one command to a running simulator.
#ifndef SIM_TELL_H
#define SIM_TELL_H

/// Prints the answer. The exit code: 0 ok, 1 refused, 69 nobody there, 75 no answer.
int sim_tell(const char *control_path, const char *command);

#endif
