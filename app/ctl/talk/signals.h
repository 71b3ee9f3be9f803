// SPDX-License-Identifier: MIT
/// SIGINT, SIGTERM and SIGHUP, counted instead of deadly, and only where the program waits.
///
/// Without `signals_catch` they keep their usual effect and the count stays 0.
#ifndef SIGNALS_H
#define SIGNALS_H

#include <signal.h>

/// From now on the three are blocked, except in a wait that uses `signals_let_in`, and counted there.
void signals_catch(void);

/// How many came.
unsigned signals_count(void);

/// The mask for ppoll. A null pointer, which leaves the mask as it is, without `signals_catch`.
const sigset_t *signals_let_in(void);

#endif
