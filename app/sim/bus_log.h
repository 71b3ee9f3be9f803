// SPDX-License-Identifier: MIT
/// What was on the bus, as a candump log: `(seconds.micros) sim ID#DATA`, stamped on CLOCK_MONOTONIC when the frame
/// ended.
///
/// Between the frames, lines that begin with `# seconds.micros` tell what was done to the world: every fault, every
/// press of the button, every `log mark`. Written in blocks at most SIM_LOG_HOLD_US after the frame.
#ifndef SIM_BUS_LOG_H
#define SIM_BUS_LOG_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

/// Nothing waits longer than this to be written.
#define SIM_LOG_HOLD_US 20000U
#define SIM_LOG_BUFFER  65536U

typedef struct {
    iw_time_us_t oldest_us; ///< IW_NEVER: nothing waits.
    size_t used;
    int fd; ///< -1: no log.
    bool tell_direction;
    char buffer[SIM_LOG_BUFFER];
} sim_bus_log_t;

/// `path` NULL: no log; "-": standard output. With `tell_direction` a line ends in " T" (a client sent it) or " R".
/// False, with errno, if the file cannot be made.
bool sim_bus_log_open(sim_bus_log_t *self, const char *path, bool tell_direction);

void sim_bus_log_frame(sim_bus_log_t *self, iw_time_us_t at_us, const iw_can_frame_t *frame, bool from_client);
void sim_bus_log_mark(sim_bus_log_t *self, iw_time_us_t at_us, const char *text);

/// Writes what waits if it is old enough; when to call again.
iw_time_us_t sim_bus_log_step(sim_bus_log_t *self, iw_time_us_t now_us);

/// Writes all that waits. A file that refuses is told on standard error, once, and ends the log.
void sim_bus_log_flush(sim_bus_log_t *self);

#endif
