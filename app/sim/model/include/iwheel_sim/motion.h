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
    bool rpm_of_rotor;     ///< Telemetry tells the rotor's rpm, not the wheel's.
    bool current_is_setpoint;
} sim_motion_config_t;

typedef struct {
    sim_motion_config_t config;
    iw_time_us_t now_us;   ///< Advanced to here.
    iw_time_us_t heard_us; ///< When the last setpoint was taken; IW_NEVER: never.
    int64_t position_nm;   ///< At the firmware's radius, since the start of the simulation.
    int64_t tick_rest;     ///< Way not yet counted as a tick.
    int64_t push_nm;       ///< Way that a hand still turns the wheel, whatever it is told; at the firmware's radius.
    int32_t speed_um_s;    ///< At the firmware's radius, in the wheel's own sense of rotation.
    int32_t accel_mm_s2;
    uint32_t ticks;
    uint32_t setpoints; ///< How many were taken.
    iw_codec_setpoint_t setpoint;
    int16_t runaway_mm_s; ///< Fault: this much faster than told, as long as it is told anything. 0: none.
    bool driven;          ///< The last setpoint still counts.
    bool blocked;         ///< Fault: cannot turn.
    bool swapped;         ///< Fault: rpm and ticks have the wrong sign.
} sim_motion_t;

/// A wheel of about 1 kg at the shaft: 4000 mm/s2, friction 700 mm/s2, 60 ms, gear 1, current as a limit.
void sim_motion_default(sim_motion_config_t *out_config);

void sim_motion_init(sim_motion_t *self, const sim_motion_config_t *config, iw_time_us_t now_us);

/// Moves on to `to_us`; an earlier time changes nothing.
void sim_motion_advance(sim_motion_t *self, iw_time_us_t to_us);

/// Takes a setpoint at `now_us`. False: not of the accepted type, ignored.
bool sim_motion_hear(sim_motion_t *self, iw_time_us_t now_us, const iw_codec_setpoint_t *setpoint);

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
