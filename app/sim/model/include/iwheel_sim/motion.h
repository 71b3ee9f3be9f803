// SPDX-License-Identifier: MIT
/// How one wheel moves: what it was told last, for how long that counts, and how it gets there.
///
/// Told a speed, it approaches it as a first-order system with the time constant `response_us`, never faster than the
/// torque of the current allows: 2000 mA give `accel_mm_s2`. Speeds are those of the wheel's firmware, which takes the
/// radius to be 192 mm; a wheel of another radius really goes faster or slower (`sim_motion_true_mm_s`).
///
/// Choices of this model where the document is silent:
/// - 1 s after its last setpoint the wheel coasts: friction alone (`coast_mm_s2`) brings it to rest.
/// - Current as a limit: 0 mA means no torque, the wheel coasts.
/// - Current as a setpoint: with a speed, its magnitude bounds the torque; speed 0 with a current is torque without a
///   speed to hold, so the wheel runs; 0/0 coasts.
/// - The unit of the acceleration field is rpm/s.
/// - A slope is held by the controller as far as the torque suffices; it moves a wheel that coasts. What a load costs in
///   speed is the droop.
/// - A kerb takes a share of the speed for as long as it lasts, recovery included.
/// - The yaw inertia of the machine passes a share of one wheel's motor on to the other (pair.h). Both together go as
///   without it; turning is slower by (1 + share) / (1 - share).
///
/// Integers only. Advanced to exact instants by its owner, so that nothing depends on how often it is called.
#ifndef IWHEEL_SIM_MOTION_H
#define IWHEEL_SIM_MOTION_H

#include "iwheel/codec.h"
#include "iwheel_sim/random.h"

/// Every setpoint type is taken.
#define SIM_TYPE_ANY (-1)
/// The radius that the wheel's firmware assumes.
#define SIM_FIRMWARE_RADIUS_MM 192

typedef struct {
    uint32_t accel_mm_s2;  ///< With 2000 mA.
    uint32_t coast_mm_s2;  ///< Friction.
    uint32_t response_us;  ///< Time constant of the speed controller.
    uint16_t radius_mm;    ///< The real one.
    uint16_t gear_turns;   ///< Turns of the rotor in `gear_per` turns of the wheel.
    uint16_t gear_per;     ///< Not 0.
    int16_t accepted_type; ///< 0..255, other setpoint types are ignored; or SIM_TYPE_ANY.
    int16_t yaw_permille;  ///< Share of the other wheel's motor that reaches this one, -900..900; 0: not coupled.
    bool rpm_of_rotor;     ///< Telemetry tells the rotor's rpm, not the wheel's.
    bool current_is_setpoint;
} sim_motion_config_t;

typedef struct {
    sim_motion_config_t config;
    iw_time_us_t now_us;      ///< Advanced to here.
    iw_time_us_t received_us; ///< When the last setpoint was taken; IW_NEVER: never.
    int64_t position_nm;      ///< At the firmware's radius, since the start of the simulation.
    int64_t tick_rest;        ///< Way not yet counted as a tick.
    int64_t push_nm;          ///< Way that a hand still turns the wheel, whatever it is told; at the firmware's radius.
    int32_t speed_um_s;       ///< At the firmware's radius, in the wheel's own sense of rotation.
    int32_t accel_mm_s2;
    int32_t motor_mm_s2;       ///< What its own motor adds.
    int32_t other_motor_mm_s2; ///< The same of the other wheel: written by the pair.
    int32_t slope_mm_s2;       ///< Gravity along the way of this wheel.
    uint32_t ticks;
    uint32_t setpoints; ///< How many were taken.
    iw_codec_setpoint_t setpoint;
    int16_t runaway_mm_s;    ///< Fault: this much faster than told, as long as it is told anything. 0: none.
    uint16_t droop_permille; ///< It settles so much below its setpoint; up to 1000.
    uint16_t kerb_permille;  ///< A kerb takes so much of the speed; up to 1000.
    bool driven;             ///< The last setpoint still counts.
    bool freewheels;         ///< Fault: the motor has no hold of the wheel.
    bool blocked;            ///< Fault: cannot turn.
    bool swapped;            ///< Fault: rpm and ticks have the wrong sign.
} sim_motion_t;

/// A wheel of about 1 kg at the shaft: 4000 mm/s2, friction 700 mm/s2, 60 ms, gear 1, current as a limit.
void sim_motion_default(sim_motion_config_t *out_config);

void sim_motion_init(sim_motion_t *self, const sim_motion_config_t *config, iw_time_us_t now_us);

/// Moves on to `to_us`; an earlier time changes nothing.
void sim_motion_advance(sim_motion_t *self, iw_time_us_t to_us);

/// Takes a setpoint at `now_us`. False: not of the accepted type, ignored.
bool sim_motion_receive(sim_motion_t *self, iw_time_us_t now_us, const iw_codec_setpoint_t *setpoint);

/// Forgets the setpoint: no power, or the firmware starts anew. The wheel coasts.
void sim_motion_release(sim_motion_t *self, iw_time_us_t now_us);

/// A hand turns the wheel over that way at the real radius, in the wheel's own sense; more is added to what is left.
void sim_motion_push(sim_motion_t *self, iw_time_us_t now_us, int32_t way_mm);

/// Speed in thousandths of rpm as telemetry means it: of wheel or rotor, sign as reported.
int64_t sim_motion_milli_rpm(const sim_motion_t *self);

/// Speed and position at the real radius.
int32_t sim_motion_true_mm_s(const sim_motion_t *self);
int64_t sim_motion_true_mm(const sim_motion_t *self);

/// What the motor draws.
uint32_t sim_motion_draw_mA(const sim_motion_t *self);

/// Speed in um/s at the firmware's radius that so many thousandths of rpm of the rotor or wheel mean.
int32_t sim_motion_um_s_of_milli_rpm(const sim_motion_config_t *config, int64_t milli_rpm);

#endif
