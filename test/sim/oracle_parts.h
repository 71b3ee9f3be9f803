// SPDX-License-Identifier: MIT
/// Interface between the parts of the oracle: input, output and consequences (oracle.c), requests (oracle_requests.c),
/// limits of current (oracle_currents.c), wheels that roll (oracle_rolling.c), the hold (oracle_hold.c).
#ifndef SIM_TEST_ORACLE_PARTS_H
#define SIM_TEST_ORACLE_PARTS_H

#include "oracle.h"

#define MS 1000U
/// While the bus accepts frames, the interval of setpoints is shorter than this.
#define GAP_US (100U * MS)
/// A cause that is an event ends if it did not occur for this long.
#define EVENT_US (1000U * MS)
/// A nonzero command this recent refuses arm and reset.
#define STALE_US (500U * MS)
/// The lease after an arm: longer than any lease of a command.
#define FIRST_LEASE_US (1000U * MS)

/// Wheels that were at standstill for this long end the zeros of a stop, and so does this much time.
#define SETTLED_US (500U * MS)
/// Duration of the zeros against a second master.
#define CONTESTED_US (10000U * MS)

/// Called immediately after a step: two contacts that disagree are reported, others are not. After a successful reset they agree.
void oracle_judge_contacts(oracle_t *self, iw_time_us_t now_us);
void oracle_judge_quarrel(oracle_t *self, iw_time_us_t now_us);

/// Stores a broken rule; only the first one is stored.
__attribute__((format(printf, 4, 5))) void oracle_break(oracle_t *self, iw_time_us_t now_us, uint32_t rule,
                                                        const char *format, ...);

/// Returns true if it happened at all and at least that long ago.
bool oracle_elapsed(iw_time_us_t now_us, iw_time_us_t since_us, iw_time_us_t span_us);

iw_time_us_t oracle_us(uint32_t ms);

/// The permission has ended: zero immediately, or by a ramp from that time on.
void oracle_hard_stop(oracle_t *self);
void oracle_soft_stop(oracle_t *self, iw_time_us_t at_us);

/// An e-stop by the line (0) or by a client (1). One within EVENT_US of the last is the same.
void oracle_note_estop(oracle_t *self, iw_time_us_t now_us, unsigned which);

/// Returns the longest duration of zeros that began at that time.
iw_time_us_t oracle_hold_max_us(const oracle_t *self, iw_time_us_t from_us);
iw_time_us_t oracle_zeros_from(const oracle_t *self, iw_time_us_t from_us);

/// Returns true if both wheels were online and at standstill for that long.
bool oracle_rested(const oracle_t *self, iw_time_us_t now_us, iw_time_us_t span_us);

/// Compares wheels that roll with the gateway's report of them.
void oracle_judge_rolling(oracle_t *self, iw_time_us_t now_us);

/// Judges a current that is a limit, before the wheel's own record of it is updated; and the reply to a drive.
void oracle_judge_limit(oracle_t *self, iw_time_us_t now_us, size_t side, const iw_command_t *command);
void oracle_judge_applied_limits(oracle_t *self, iw_time_us_t now_us, const iw_drive_t *request,
                                 const iw_applied_t *applied);

/// Returns true if that command would turn the machine faster than configured.
bool oracle_turns_too_fast(const oracle_t *self, int32_t left_mm_s, int32_t right_mm_s);

/// Called immediately after a step: the setpoints do not turn the machine too fast, nor faster too soon.
void oracle_judge_turn(oracle_t *self, iw_time_us_t now_us);

/// The hold of after_stop: arm and a latch request it; release and shutdown end it; another master may end it.
void oracle_hold_asked(oracle_t *self);
void oracle_hold_latched(oracle_t *self, iw_time_us_t now_us);
void oracle_hold_ended(oracle_t *self);
void oracle_hold_foreign(oracle_t *self);
/// Returns true if zeros must continue, whatever the time.
bool oracle_holds(const oracle_t *self);
/// Called before `state` is stored, and at the end of a step.
void oracle_judge_hold_state(oracle_t *self, iw_time_us_t now_us, iw_state_t state);
void oracle_judge_hold(oracle_t *self, iw_time_us_t now_us);

/// The public state has changed, or may have.
void oracle_observe(oracle_t *self, iw_time_us_t now_us);

#endif
