// SPDX-License-Identifier: MIT
/// A bridge and the gateway's own loop (daemon_rig.h) in one process and one virtual time.
///
/// A program that is linked with this file uses its clock_gettime, ppoll and connect for the bridge and its client: the option is
/// `-Wl,--wrap=clock_gettime,--wrap=ppoll,--wrap=connect`. A wait of the bridge runs the gateway; a unix socket of any name is
/// the rig's gateway. Libraries that are not linked statically stay in real time.
#ifndef TEST_HOURS_RIG_H
#define TEST_HOURS_RIG_H

#include "daemon_rig.h"

/// Stops the gateway, as SIGSTOP does; time goes on.
extern bool hours_gateway_hangs;

/// Runs the gateway's world for that long; without a running one, only the time passes.
void hours_run_gateway(unsigned for_ms);

/// Returns the wall clock of the bridge.
int64_t hours_wall_ns(void);

/// Returns the number of open descriptors of this process.
unsigned hours_descriptors(void);

#endif
