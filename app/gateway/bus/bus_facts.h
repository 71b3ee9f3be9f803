// SPDX-License-Identifier: MIT
/// What the kernel reports of the bus, put to the core, into the warnings and into `--check`.
#ifndef GATEWAY_BUS_FACTS_H
#define GATEWAY_BUS_FACTS_H

#include "daemon.h"
#include "inspect.h"

/// Passes on what has changed since the last call: to the core, to the warnings, to the log. Call it before a step.
void gw_bus_facts_follow(gw_daemon_t *daemon);

/// The word for `status`: what is known of the bit timing.
const char *gw_bus_facts_timing(const gw_daemon_t *daemon);

/// What the configuration wants the bus to be.
inspect_wish_t gw_bus_facts_wish(const gw_daemon_t *daemon);

/// What is to be said of the link, each with the command that mends it.
void gw_bus_facts_judge(const gw_daemon_t *daemon, inspect_findings_t *findings);

#endif
