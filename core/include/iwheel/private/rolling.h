// SPDX-License-Identifier: MIT
/// @file
/// Do the wheels turn although nothing is sent to them?
///
///     STILL --a wheel faster than IW_ROLLING_MM_S for IW_ROLLING_US--> ROLLING
///       ^                                                                 |
///       +------------- both wheels slower for IW_ROLLING_US --------------+
///
/// People push a walker by hand, so rolling is an event and no cause of a stop. It is a fault only if it begins within
/// IW_ROLLING_AFTER_US after the last setpoint: the machine then rolls away after a stop.
///
/// Pure state machine: no I/O, no clock.
#ifndef IW_ROLLING_H
#define IW_ROLLING_H

#include "iwheel/types.h"

/// A wheel that is faster than this turns. Safety rule.
#define IW_ROLLING_MM_S 100
/// So long it must turn, or no longer turn. Safety rule.
#define IW_ROLLING_US 300000U
/// After the last setpoint a machine that begins to roll has a fault for so long. Safety rule.
#define IW_ROLLING_AFTER_US 10000000U

/// Whether the wheels roll.
typedef struct {
    bool rolling;          ///< They turn and nothing is sent to them.
    bool is_fault;         ///< That began soon after the last setpoint. False while not rolling.
    iw_time_us_t since_us; ///< Since when they have done otherwise than `rolling` says; IW_NEVER: they do as it says.
    iw_time_us_t setpoint_us; ///< When setpoints were last due, written by the owner; IW_NEVER: not yet.
} iw_rolling_t;

/// Begins with wheels that stand.
void iw_rolling_init(iw_rolling_t *self);

/// `turns`: nothing is sent and a wheel is faster than IW_ROLLING_MM_S.
void iw_rolling_step(iw_rolling_t *self, iw_time_us_t now_us, bool turns);

#endif
