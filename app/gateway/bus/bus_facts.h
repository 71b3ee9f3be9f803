// SPDX-License-Identifier: MIT
/// Passes facts about the bus from the kernel to the core, and to the warnings.
#ifndef GATEWAY_BUS_FACTS_H
#define GATEWAY_BUS_FACTS_H

#include "inspect.h"

struct gw_wheels;

typedef struct gw_bus_facts {
    uint32_t changes; ///< `changes` of the link when it was last passed on.
    bool known;       ///< The link has been passed on once.
    bool left_behind; ///< A warning about `left_behind` is active.
    uint32_t health;  ///< Changes of the wheels' health at the last warning.
    bool untried;     ///< A warning about an untested e-stop button is active.
} gw_bus_facts_t;

/// Passes changes since the last call to the core and to the warnings. Call it before a step. `left_behind`: a setpoint
/// remains in the controller, by the last snapshot.
void gw_bus_facts_follow(gw_bus_facts_t *self, struct gw_wheels *wheels, bool left_behind);

/// Returns the word for `status` about the bit timing.
const char *gw_bus_facts_timing(const inspect_config_t *config, const iwl_bus_link_t *link);

/// Handling of a setpoint that remains in the controller after sending has ended, and that this process has no rights
/// to purge.
///
/// The gateway requests a restart of the link by writing the file `DIRECTORY/INTERFACE.restart`. The unit
/// iwheel-can-restart@INTERFACE.path waits for it; it is disabled by default. The gateway detects the restart like any
/// other: the bus goes down and up, and all queued frames are gone.
///
/// Writes the meaning of that state, and the fix.
void gw_bus_left_sentence(const iwl_bus_link_t *link, const char *bus, char *out_sentence, size_t size);

/// Requests the restart. Returns false if it cannot: the directory does not exist or is not writable. It does not wait
/// for a disk, because the directory should be in memory.
bool gw_bus_left_ask(const char *directory, const char *interface);

#endif
