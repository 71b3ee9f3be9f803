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
    uint32_t health;  ///< Changes of the wheels' health when last warned of.
    bool untried;     ///< The same: nobody has seen the button of the e-stop work.
} gw_bus_facts_t;

/// Passes on what has changed since the last call: to the core and to the warnings. Call it before a step. `left_behind` as last
/// seen: a setpoint is left in the controller.
void gw_bus_facts_follow(gw_bus_facts_t *self, struct gw_wheels *wheels, bool left_behind);

/// The word for `status`: what is known of the bit timing.
const char *gw_bus_facts_timing(const inspect_config_t *config, const iwl_bus_link_t *link);

/// A setpoint that was left in the controller when sending ended, and that this process may not take back: what to say
/// of it, and whom to ask.
///
/// Whoever may restart the link is asked by a file that is written anew: `DIRECTORY/INTERFACE.restart`. The unit
/// iwheel-can-restart@INTERFACE.path waits for that; it is off unless somebody has enabled it. The gateway notices the
/// restart as it notices any other: the bus goes down and up, and with that everything that was queued is gone.
///
/// What it means, and what to do.
void gw_bus_left_sentence(const iwl_bus_link_t *link, const char *bus, char *out_sentence, size_t size);

/// False if nobody can be asked: there is no such directory, or we may not write there. Does not wait for a disk: the
/// directory is meant to be in memory.
bool gw_bus_left_ask(const char *directory, const char *interface);

#endif
