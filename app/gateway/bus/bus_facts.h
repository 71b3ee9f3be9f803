// SPDX-License-Identifier: MIT
/// What the kernel reports of the bus, put to the core and into the warnings.
#ifndef GATEWAY_BUS_FACTS_H
#define GATEWAY_BUS_FACTS_H

#include "wheels/wheels.h"

#include "inspect.h"

typedef struct {
    inspect_wish_t wish; ///< What the bus is to be, by the configuration.
    uint32_t changes;    ///< Of the link, when last passed on.
    bool known;          ///< It has been passed on once.
    bool left_behind;    ///< What was warned of.
} gw_bus_facts_t;

/// Passes on what has changed since the last call: to the core and to the warnings. Call it before a step. `left_behind` as last
/// seen: a setpoint is left in the controller.
void gw_bus_facts_follow(gw_bus_facts_t *self, gw_wheels_t *wheels, bool left_behind);

/// The word for `status`: what is known of the bit timing.
const char *gw_bus_facts_timing(const gw_bus_facts_t *self, const iw_bus_link_t *link);

#endif
