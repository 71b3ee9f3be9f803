// SPDX-License-Identifier: MIT
/// What the kernel reports of the bus, put to the core and into the daemon's warnings.
#ifndef GATEWAY_BUS_FACTS_H
#define GATEWAY_BUS_FACTS_H

#include "daemon.h"
#include "inspect.h"

/// Passes on what has changed since the last call: to the core, to the warnings, to the log. Call it before a step.
void gw_bus_facts_follow(gw_daemon_t *daemon);

/// The word for `status`: what is known of the bit timing.
const char *gw_bus_facts_timing(const gw_daemon_t *daemon);

/// What the configuration wants the bus to be.
inspect_wish_t gw_bus_facts_wish(const gateway_config_t *config);

#endif
