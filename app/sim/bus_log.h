// SPDX-License-Identifier: MIT
/// Log of the frames on the bus in candump format: `(seconds.micros) sim ID#DATA`. The stamp is CLOCK_MONOTONIC at the
/// end of the frame.
///
/// Between the frames, lines that begin with `# seconds.micros` report each change of the world: every fault, every
/// press of the button, every `log mark`. Lines are written in blocks, at most SIM_LOG_HOLD_US after the frame.
#ifndef SIM_BUS_LOG_H
#define SIM_BUS_LOG_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

/// Longest time for which a line waits before it is written.
#define SIM_LOG_HOLD_US 20000U
#define SIM_LOG_BUFFER  65536U

typedef struct {
    iw_time_us_t oldest_us; ///< Time of the oldest waiting line; IW_NEVER: no line waits.
    size_t used;
    int fd; ///< -1: no log.
    bool write_direction;
    char buffer[SIM_LOG_BUFFER];
} sim_bus_log_t;

/// Opens the log. `path` NULL: no log; "-": standard output. With `write_direction` a line ends in " T" (a client sent
/// the frame) or " R". Returns false, with errno, if the file cannot be created.
bool sim_bus_log_open(sim_bus_log_t *self, const char *path, bool write_direction);

void sim_bus_log_frame(sim_bus_log_t *self, iw_time_us_t at_us, const iw_can_frame_t *frame, bool from_client);
void sim_bus_log_mark(sim_bus_log_t *self, iw_time_us_t at_us, const char *text);

/// Writes the waiting lines if they are old enough. Returns the time of the next call; IW_NEVER if no line waits.
iw_time_us_t sim_bus_log_step(sim_bus_log_t *self, iw_time_us_t now_us);

/// Writes all waiting lines. If the file cannot be written, this is printed on standard error once, and the log ends.
void sim_bus_log_flush(sim_bus_log_t *self);

#endif
