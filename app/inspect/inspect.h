// SPDX-License-Identifier: MIT
/// The judges: what was read of the link, heard on the bus and asked of the e-stop, put into findings.
#ifndef INSPECT_H
#define INSPECT_H

#include "findings.h"
#include "heard.h"

/// What the bus is meant to be.
typedef struct {
    const char *name; ///< Interface or unix:PATH.
    uint32_t bitrate_hz;
    uint16_t sample_point_permille;
    bool refuses;         ///< A wrong timing is a failure, not only a warning.
    bool others_may_send; ///< A gateway runs on this bus: setpoints on it may be its own, and it judges the others.
} inspect_wish_t;

/// Presence, mode, bit timing, queue, restart-ms, echo. Nothing for the local bus.
void inspect_link(const iw_bus_link_t *link, const inspect_wish_t *wish, inspect_findings_t *findings);

/// Whether the bus lives, both wheels and the rate of each id, load, unknown ids, damaged frames, other masters.
void inspect_bus(const iw_bus_link_t *link, const inspect_heard_t *heard, const inspect_wish_t *wish,
                 inspect_findings_t *findings);

/// What is known of the e-stop.
typedef struct {
    const char *line; ///< Its name in the configuration.
    bool present;     ///< False: there is none at all.
    bool simulated;
    int level;           ///< As in iw_hal_t: 0 released, > 0 pressed, < 0 unreadable.
    const char *trouble; ///< Why it is unreadable, and what to do; may be empty.
    bool no_gpio;        ///< It would be a line of a GPIO chip, and this machine has none.
} inspect_estop_t;

/// The same from an open HAL, as last asked.
inspect_estop_t inspect_estop_of(const iw_linux_hal_t *hal, const char *line);

/// The e-stop's level.
void inspect_estop(const inspect_estop_t *estop, inspect_findings_t *findings);

/// Why the e-stop cannot be read, and what to do about it; empty while it can.
const char *inspect_estop_trouble(const iw_linux_hal_t *hal);

/// A bus or an e-stop that cannot be opened at all: `error` of iw_linux_hal_open.
void inspect_unopened(const char *culprit, bool is_bus, int error, inspect_findings_t *findings);

/// What could be opened.
typedef struct {
    bool hal; ///< At all: then it is to be closed.
    bool bus;
    bool estop;
} inspect_opened_t;

/// Opens bus and e-stop to look at them. What cannot be opened is told as a finding, and the other one is opened all the same.
inspect_opened_t inspect_open(iw_linux_hal_t *hal, const char *bus, const iw_estop_wish_t *line,
                              inspect_findings_t *findings);

#endif
