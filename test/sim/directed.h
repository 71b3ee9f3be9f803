// SPDX-License-Identifier: MIT
/// Cases that the swarm meets too seldom: a node that babbles without a pause, with ids of higher and of lower priority.
#ifndef SIM_TEST_DIRECTED_H
#define SIM_TEST_DIRECTED_H

/// Plays all cases, prints a line for each on stdout, then "N passed, N failed, N skipped". Returns the exit status.
int directed_play(void);

#endif
