// SPDX-License-Identifier: MIT
/// What the swarm meets too seldom: a node that babbles without a pause, on ids that win and on ids that lose.
#ifndef SIM_TEST_DIRECTED_H
#define SIM_TEST_DIRECTED_H

/// Plays all cases, tells each on stdout, then "N passed, N failed, N skipped". Returns the exit status.
int directed_play(void);

#endif
