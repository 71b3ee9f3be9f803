// SPDX-License-Identifier: MIT
/// A setpoint that was left in the controller when sending ended, and that this process may not take back: what to say
/// of it, and whom to ask.
///
/// Whoever may restart the link is asked by a file that is written anew: `DIRECTORY/INTERFACE.restart`. The unit
/// iwheel-can-restart@INTERFACE.path waits for that; it is off unless somebody has enabled it. The gateway notices the
/// restart as it notices any other: the bus goes down and up, and with that everything that was queued is gone.
#ifndef GATEWAY_BUS_LEFT_H
#define GATEWAY_BUS_LEFT_H

#include "iwheel_linux/bus_link.h"

#include <stddef.h>

/// What it means, and what to do.
void gw_bus_left_sentence(const iw_bus_link_t *link, const char *bus, char *out_sentence, size_t size);

/// False if nobody can be asked: there is no such directory, or we may not write there. Does not wait for a disk: the
/// directory is meant to be in memory.
bool gw_bus_left_ask(const char *directory, const char *interface);

#endif
