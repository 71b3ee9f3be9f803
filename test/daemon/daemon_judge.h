// SPDX-License-Identifier: MIT
/// Judges the gateway by the input and output of its process: bytes that it has read from clients, edges of the button, frames
/// that it received and sent. The judge does not know the gateway's code; it is written from the rules of the safety case.
///
/// An *end* removes every client's permission to move: later than `limit` after it, nonzero requires an arm and then a drive that were
/// read after it. Time in which the process could not run does not count. The first broken rule is stored.
#ifndef DAEMON_JUDGE_H
#define DAEMON_JUDGE_H

#include "daemon_world.h"

/// Maximum time from an end without a ramp to setpoints of zero.
#define JUDGE_REACTION_US 6000U

typedef enum { SAID_ARM, SAID_DRIVE, SAID_ZERO, SAID_STOP, SAID_ESTOP, SAID_RESET } said_t;

void judge_begin(const scenario_t *scenario, result_t *result);
void judge_break(uint32_t rule, const char *format, ...) __attribute__((format(printf, 2, 3)));

void judge_life(void);           ///< The process starts,
void judge_death(bool in_order); ///< and ends, killed or not.
/// The frames of one call; `judge_frame` follows for each frame that the kernel tries to send.
void judge_call(const iw_can_frame_t *first, unsigned count);
void judge_frame(const iw_can_frame_t *frame, bool accepted);
void judge_on_bus(const iw_can_frame_t *frame); ///< A frame of the gateway or of another node.
void judge_foreign_on_bus(void);
void judge_echo(unsigned side);
void judge_bus_lost(void);
void judge_end(const char *why, iw_time_us_t limit_us);
void judge_said(unsigned client, said_t what);
void judge_wanted(unsigned client, int32_t left, int32_t right); ///< A drive for these speeds was read.
void judge_gone(unsigned client);
void judge_stopped(iw_time_us_t span_us); ///< The process did not run for that long.
void judge_tick(void);
/// The bus has a fault now.
void judge_bus_fault(void);
phase_t judge_phase(void);
bool judge_is_silent(iw_time_us_t for_us);

#endif
