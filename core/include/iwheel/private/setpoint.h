// SPDX-License-Identifier: MIT
/// @file
/// Which setpoint pair is due now, and when is the next one?
///
/// Pure state machine: no I/O and no clock. What to aim at is told by the motion permission as a demand; what the
/// client wants by `iw_setpoint_command`.
///
///     SILENCE --any other demand--> (first pair: zero) --FOLLOW--> ramps to the command
///                                                      --BRAKE --> ramps to zero
///                                                      --ZERO  --> zero at once
///
/// Ramps follow elapsed time, not calls. Both wheels ramp together: the one with the longest way sets the pace, so a
/// machine in a curve stays in it while it stops. But an accelerating wheel never holds up one that brakes. A sign
/// change passes through zero. Away from zero a late call is granted two periods at the most (no burst); towards zero
/// the whole time.
///
/// Under a command other than 0/0 the difference of both wheels grows no faster, and no further, than yaw.h allows.
///
/// Pairs lie on a grid of `period_ms`. A changed command or demand moves the next pair forward, at least
/// IW_SETPOINT_SPACING_US after the last one; ZERO is due at once.
#ifndef IW_SETPOINT_H
#define IW_SETPOINT_H

#include "iwheel/config.h"
#include "iwheel/private/yaw.h"

/// A changed command leaves at once, but not sooner than this after the last pair.
#define IW_SETPOINT_SPACING_US 5000U

/// Ramp and grid of both wheels.
typedef struct {
    const iw_config_t *config; ///< The owner's.
    iw_demand_t demand;        ///< As told last.
    bool from_zero;       ///< The next pair is zero whatever the command: the first after silence, ZERO or a collapse.
    iw_time_us_t last_us; ///< When the last pair was taken.
    iw_time_us_t due_us;  ///< When the next one is due; IW_NEVER in silence.
    iw_pair_t target;     ///< The client's command, cleared whenever the demand is not FOLLOW.
    int32_t speed_um_s[IW_SIDES]; ///< Where the ramp is.
    int32_t current_uA[IW_SIDES]; ///< Ramped only with IW_ROLE_SETPOINT.
    int16_t limit_mA[IW_SIDES];   ///< IW_ROLE_LIMIT: as last taken. See current.h.
    iw_yaw_t yaw;                 ///< How fast the pair may turn the machine.
} iw_setpoint_t;

/// `config` must be checked and outlive it. Begins in silence.
void iw_setpoint_init(iw_setpoint_t *self, const iw_config_t *config);

/// Tells what to aim at. The same demand again changes nothing.
void iw_setpoint_demand(iw_setpoint_t *self, iw_time_us_t now_us, iw_demand_t demand);

/// The client's new command, already within the limits. Ignored unless the demand is FOLLOW.
void iw_setpoint_command(iw_setpoint_t *self, iw_time_us_t now_us, const iw_pair_t *target);

/// Moves the next pair forward, but not closer than IW_SETPOINT_SPACING_US to the last one. Nothing in silence.
void iw_setpoint_hasten(iw_setpoint_t *self, iw_time_us_t now_us);

/// Zero at once, whatever the demand, and the command is forgotten: the last pair could not be sent whole, or somebody
/// else commands from now on. The zero is hastened; under FOLLOW the ramp to the next command starts from it, also if
/// the command comes before it.
void iw_setpoint_collapse(iw_setpoint_t *self, iw_time_us_t now_us);

/// True if a pair must leave now.
static inline bool iw_setpoint_due(const iw_setpoint_t *self, iw_time_us_t now_us) {
    return now_us >= self->due_us;
}

/// Advances the ramp to now, hands out the pair that must leave now and sets the time of the next.
iw_pair_t iw_setpoint_take(iw_setpoint_t *self, iw_time_us_t now_us);

/// The pair as last taken, in the machine's frame (not inverted).
iw_pair_t iw_setpoint_applied(const iw_setpoint_t *self);

/// True if the output is zero: the pair last taken was, or a collapse or a new demand has made it so.
bool iw_setpoint_is_zero(const iw_setpoint_t *self);

/// True if the next pair will be zero, whenever it is taken.
bool iw_setpoint_next_is_zero(const iw_setpoint_t *self);

/// When a pair is due; IW_NEVER in silence.
static inline iw_time_us_t iw_setpoint_next_us(const iw_setpoint_t *self) {
    return self->due_us;
}

#endif
