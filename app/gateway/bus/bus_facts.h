// SPDX-License-Identifier: MIT
/// What the kernel reports of the bus, put to the core and into the warnings.
#ifndef GATEWAY_BUS_FACTS_H
#define GATEWAY_BUS_FACTS_H

#include "inspect.h"

struct gw_wheels;

typedef struct gw_bus_facts {
    uint32_t changes; ///< Of the link, when last passed on.
    bool known;       ///< It has been passed on once.
    bool left_behind; ///< What was warned of.
} gw_bus_facts_t;

/// Passes on what has changed since the last call: to the core and to the warnings. Call it before a step. `left_behind` as last
/// seen: a setpoint is left in the controller.
void gw_bus_facts_follow(gw_bus_facts_t *self, struct gw_wheels *wheels, bool left_behind);

/// The word for `status`: what is known of the bit timing.
const char *gw_bus_facts_timing(const inspect_wish_t *wish, const iw_bus_link_t *link);

#endif
