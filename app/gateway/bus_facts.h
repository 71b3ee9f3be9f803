// SPDX-License-Identifier: MIT
/// What the kernel reports of the bus, put to the core, into the warnings and into `--check`.
#ifndef GATEWAY_BUS_FACTS_H
#define GATEWAY_BUS_FACTS_H

#include "daemon.h"

/// Room for a sentence of this module.
#define GW_FACT_SIZE 400U

/// Passes on what has changed since the last call: to the core, to the warnings, to the log. Call it before a step.
void gw_bus_facts_follow(gw_daemon_t *daemon);

/// The word for `status`: what is known of the bit timing.
const char *gw_bus_facts_timing(const gw_daemon_t *daemon);

typedef enum { GW_FACT_OK, GW_FACT_WARN, GW_FACT_FAIL } gw_fact_verdict_t;

/// Hands out, one after the other, what is to be said of the link, each with the command that mends it: index 0, 1, ...
/// until it returns false. Writes an empty sentence where there is nothing to say.
bool gw_bus_facts_tell(const gw_daemon_t *daemon, unsigned index, gw_fact_verdict_t *out_verdict,
                       char out_text[GW_FACT_SIZE]);

#endif
