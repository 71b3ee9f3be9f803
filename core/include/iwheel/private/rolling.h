// SPDX-License-Identifier: MIT
/// @file
/// Detects wheels that turn while nothing is sent to them.
///
///     STILL --a wheel faster than IW_ROLLING_MM_S for IW_ROLLING_US--> ROLLING
///       ^                                                                 |
///       +------------- both wheels slower for IW_ROLLING_US --------------+
///
/// People push a walker by hand, so rolling is an event, not a cause of a stop. It is a fault only if it begins within
/// IW_ROLLING_AFTER_US after the last setpoint: then the machine rolls away after a stop.
///
/// Pure state machine: no I/O, no clock.
#ifndef IW_ROLLING_H
#define IW_ROLLING_H

#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A wheel that is faster than this turns. Safety rule.
#define IW_ROLLING_MM_S 100
/// Duration of turning, or of not turning, that changes the state. Safety rule.
#define IW_ROLLING_US 300000U
/// Rolling that begins within this time after the last setpoint is a fault. Safety rule.
#define IW_ROLLING_AFTER_US 10000000U

/// State of the detection.
typedef struct {
    bool rolling;          ///< The wheels turn and nothing is sent to them.
    bool is_fault;         ///< Rolling began within IW_ROLLING_AFTER_US. False while not rolling.
    iw_time_us_t since_us; ///< Start of a motion that contradicts `rolling`; IW_NEVER if there is none.
    iw_time_us_t
        setpoint_us; ///< Last time at which setpoints were due, written by the owner; IW_NEVER if there is none.
} iw_rolling_t;

/// Initializes `self` with wheels at standstill.
void iw_rolling_init(iw_rolling_t *self);

/// Advances the state. `turns`: nothing is sent and a wheel is faster than IW_ROLLING_MM_S.
void iw_rolling_step(iw_rolling_t *self, iw_time_us_t now_us, bool turns);

#ifdef __cplusplus
}
#endif
#endif
