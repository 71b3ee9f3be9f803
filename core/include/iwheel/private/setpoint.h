// SPDX-License-Identifier: MIT
/// @file
/// Setpoint scheduler: selects the setpoint pair that is due, and the time of the next one.
///
/// Pure state machine: no I/O and no clock. The motion permission sets the demand, and `iw_setpoint_command` sets the
/// command of the client.
///
///     SILENCE --any other demand--> (first pair: zero) --FOLLOW--> ramps to the command
///                                                      --BRAKE --> ramps to zero
///                                                      --ZERO  --> zero immediately
///
/// Ramps follow elapsed time, not the number of calls. Both wheels ramp together: the wheel with the largest change
/// sets the pace, so that a machine in a curve stays on the curve while it stops. An accelerating wheel never delays a
/// braking one. A change of sign passes through zero. After a late call the ramp away from zero advances by two periods
/// at most, so that there is no burst; the ramp towards zero advances by the whole time.
///
/// With a command other than 0/0, yaw.h limits the difference of both wheels and its growth.
///
/// Pairs have a grid of `period_ms`. A new command or demand moves the next pair forward, to IW_SETPOINT_SPACING_US
/// after the last one or later. ZERO is due immediately.
#ifndef IW_SETPOINT_H
#define IW_SETPOINT_H

#include "iwheel/config.h"
#include "iwheel/private/yaw.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Shortest interval between the last pair and the pair of a new command.
#define IW_SETPOINT_SPACING_US 5000U

/// State of the scheduler.
typedef struct {
    const iw_config_t *config;    ///< Configuration of the owner.
    iw_demand_t demand;           ///< Last demand.
    bool from_zero;               ///< The next pair is zero, whatever the command: after a pause, ZERO or a collapse.
    iw_time_us_t last_us;         ///< Time of the last pair.
    iw_time_us_t due_us;          ///< Time of the next pair; IW_NEVER if none is due.
    iw_pair_t target;             ///< Command of the client. Cleared when the demand is not FOLLOW.
    int32_t speed_um_s[IW_SIDES]; ///< Present speeds of the ramp.
    int32_t current_uA[IW_SIDES]; ///< Present currents of the ramp, with IW_ROLE_SETPOINT only.
    int16_t limit_mA[IW_SIDES];   ///< Last current limits, with IW_ROLE_LIMIT. See current.h.
    iw_yaw_t yaw;                 ///< Yaw limits of the pair.
} iw_setpoint_t;

/// Initializes `self` with the demand SILENCE. `config` must be checked, and must exist as long as `self`.
void iw_setpoint_init(iw_setpoint_t *self, const iw_config_t *config);

/// Sets the demand. The same demand again has no effect.
void iw_setpoint_demand(iw_setpoint_t *self, iw_time_us_t now_us, iw_demand_t demand);

/// Sets the command of the client, which must be within the limits. Ignored unless the demand is FOLLOW.
void iw_setpoint_command(iw_setpoint_t *self, iw_time_us_t now_us, const iw_pair_t *target);

/// Moves the next pair forward, to IW_SETPOINT_SPACING_US after the last one or later. No effect if none is due.
void iw_setpoint_hasten(iw_setpoint_t *self, iw_time_us_t now_us);

/// Sets the ramp to zero immediately, whatever the demand, and clears the command: the port has not accepted the last
/// pair as a whole, or the lease has moved to another client. The zero pair is hastened. With FOLLOW the ramp to the
/// next command starts at this zero, even if the command arrives before the pair.
void iw_setpoint_collapse(iw_setpoint_t *self, iw_time_us_t now_us);

/// Returns true if a pair must be sent now.
static inline bool iw_setpoint_due(const iw_setpoint_t *self, iw_time_us_t now_us) {
    return now_us >= self->due_us;
}

/// Advances the ramp to now, returns the pair that must be sent now, and sets the time of the next one.
iw_pair_t iw_setpoint_next(iw_setpoint_t *self, iw_time_us_t now_us);

/// Returns the last pair of `iw_setpoint_next`, in the machine's frame (not inverted).
iw_pair_t iw_setpoint_applied(const iw_setpoint_t *self);

/// Returns true if the output is zero: the last pair was zero, or a collapse or a new demand has set it to zero.
bool iw_setpoint_is_zero(const iw_setpoint_t *self);

/// Returns true if the next pair will be zero at any time.
bool iw_setpoint_next_is_zero(const iw_setpoint_t *self);

/// Returns the time of the next pair, or IW_NEVER.
static inline iw_time_us_t iw_setpoint_next_us(const iw_setpoint_t *self) {
    return self->due_us;
}

#ifdef __cplusplus
}
#endif
#endif
