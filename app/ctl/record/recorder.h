// SPDX-License-Identifier: MIT
/// A recording being made: where it is written, for how long, from where the frames come.
#ifndef RECORDER_H
#define RECORDER_H

#include "candump.h"
#include "talk/ctl.h"

#include <stdio.h>

typedef struct {
    FILE *file;
    const char *name; ///< Of the file, as shown; "standard output".
    char interface[CANDUMP_INTERFACE_SIZE];
    char bus[128];         ///< As it was asked for, or as the gateway names it.
    bool from_gateway;     ///< Else from the bus itself.
    int64_t wall_minus_us; ///< Wall clock minus monotonic clock, of the whole recording: its times never step.
    int64_t end_us;        ///< Monotonic; INT64_MAX: until a signal.
    int64_t first_us;      ///< Of the first frame.
    int64_t last_us;
    uint64_t frames;
    uint64_t lost; ///< That are known to be missing.
    int64_t flushed_us;
} recorder_t;

/// Writes one frame that came at `at_us` (monotonic). False: it cannot be written, errno tells why.
bool recorder_put(recorder_t *self, const candump_t *frame, int64_t at_us);

/// Lets others see what was written, once a second. False as above.
bool recorder_tend(recorder_t *self);

/// Records what the gateway (which is connected) sees, until the end or a signal. An exit code.
int recorder_from_gateway(ctl_t *ctl, recorder_t *self);

/// Records from the bus itself, without ever sending. An exit code.
int recorder_from_bus(const char *bus, recorder_t *self);

#endif
