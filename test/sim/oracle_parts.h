// SPDX-License-Identifier: MIT
/// What the parts of the oracle share: what it sees and what follows (oracle.c), requests (oracle_requests.c),
/// limits of current (oracle_currents.c), wheels that roll (oracle_rolling.c), the hold (oracle_hold.c).
#ifndef SIM_TEST_ORACLE_PARTS_H
#define SIM_TEST_ORACLE_PARTS_H

#include "oracle.h"

#define MS 1000U
/// While the bus takes frames, setpoints come closer than this.
#define GAP_US (100U * MS)
/// An event-like cause is gone when not seen for this long.
#define EVENT_US (1000U * MS)
/// A nonzero command this recent refuses arm and reset.
#define STALE_US (500U * MS)
/// What arm gives: longer than any lease.
#define FIRST_LEASE_US (1000U * MS)

/// Wheels that stood for this long end the zeros of a stop, and so does this much time.
#define SETTLED_US (500U * MS)
/// Against a second master.
#define CONTESTED_US (10000U * MS)

/// Right after the step: two contacts that disagree are told, and others are not. After a reset that was done: they do not.
void oracle_judge_contacts(oracle_t *self, iw_time_us_t now_us);
void oracle_judge_quarrel(oracle_t *self, iw_time_us_t now_us);

/// A rule is broken; the first one is kept.
__attribute__((format(printf, 4, 5))) void oracle_break(oracle_t *self, iw_time_us_t now_us, uint32_t rule,
                                                        const char *format, ...);

/// True if it happened at all, and that long ago.
bool oracle_elapsed(iw_time_us_t now_us, iw_time_us_t since_us, iw_time_us_t span_us);

iw_time_us_t oracle_us(uint32_t ms);

/// Permission is over: zero at once, or by a ramp from then on.
void oracle_hard_stop(oracle_t *self);
void oracle_soft_stop(oracle_t *self, iw_time_us_t at_us);

/// The longest time of zeros that began then.
iw_time_us_t oracle_hold_max_us(const oracle_t *self, iw_time_us_t from_us);
iw_time_us_t oracle_zeros_from(const oracle_t *self, iw_time_us_t from_us);

/// Both wheels were heard, and stood for that long.
bool oracle_rested(const oracle_t *self, iw_time_us_t now_us, iw_time_us_t span_us);

/// Wheels that roll, against what the gateway tells of them.
void oracle_judge_rolling(oracle_t *self, iw_time_us_t now_us);

/// A current that is a limit, before the wheel's own record of it; the answer to a drive.
void oracle_judge_limit(oracle_t *self, iw_time_us_t now_us, size_t side, const iw_command_t *command);
void oracle_judge_applied_limits(oracle_t *self, iw_time_us_t now_us, const iw_drive_t *request,
                                 const iw_applied_t *applied);

/// That command would turn the machine faster than configured.
bool oracle_turns_too_fast(const oracle_t *self, int32_t left_mm_s, int32_t right_mm_s);

/// Right after the step: what was sent turns the machine no faster, and not faster too soon.
void oracle_judge_turn(oracle_t *self, iw_time_us_t now_us);

/// The hold of after_stop: arm asks for it, and a latch; release and shutdown end it; another master may.
void oracle_hold_asked(oracle_t *self);
void oracle_hold_latched(oracle_t *self, iw_time_us_t now_us);
void oracle_hold_ended(oracle_t *self);
void oracle_hold_foreign(oracle_t *self);
/// Zeros must go on, whatever the time.
bool oracle_holds(const oracle_t *self);
/// Before `state` is taken over, and at the end of a step.
void oracle_judge_hold_state(oracle_t *self, iw_time_us_t now_us, iw_state_t state);
void oracle_judge_hold(oracle_t *self, iw_time_us_t now_us);

/// The public state changed, or may have.
void oracle_observe(oracle_t *self, iw_time_us_t now_us);

#endif
