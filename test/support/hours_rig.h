// SPDX-License-Identifier: MIT
/// A bridge and the gateway's own loop (daemon_rig.h) in one process and one virtual time.
///
/// Who is linked with this leads clock_gettime, ppoll and connect of the bridge and its client here: the option
/// `-Wl,--wrap=clock_gettime,--wrap=ppoll,--wrap=connect`. A wait of the bridge's lets the gateway go on; a unix socket by whatever name is
/// the rig's gateway. Libraries that are not linked statically stay in real time.
#ifndef TEST_HOURS_RIG_H
#define TEST_HOURS_RIG_H

#include "daemon_rig.h"

/// The gateway stands still, as by SIGSTOP; time goes on.
extern bool hours_gateway_hangs;

/// The gateway's world goes on for so long, if there is one that does; else only the time.
void hours_run_gateway(unsigned for_ms);

/// The wall clock, as the bridge sees it.
int64_t hours_wall_ns(void);

/// Open descriptors of this process.
unsigned hours_descriptors(void);

#endif
